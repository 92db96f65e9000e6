#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.h"
#include "idl/types/spatial.h"

namespace tenon::station {

/// Device poses of one hand over time, from a CSV file with the header `t,x,y,z,qw,qx,qy,qz`: seconds, metres
/// and the quaternion q_WH, in the world.
///
/// Between two rows the position is linear in time and the orientation turns by the smaller angle at constant
/// angular velocity (slerp). The first row holds before its time, the last one after it. Poses have the same
/// bits on every processor.
///
/// Threads: constant once read. Real-time: poseAt, lineAt, end.
class HandTrajectory {
 public:
  /// Fails with `file:line: what was wrong, what was expected`: a missing header or no row, a row without
  /// eight finite numbers, times that do not rise, a quaternion whose length differs from 1 by more than 0.01
  /// (a nearer one is normalised). Blank lines, blanks around numbers, CR LF and a byte order mark are
  /// accepted. `file` names the text in errors.
  [[nodiscard]] static Result<HandTrajectory> parse(std::string_view text, const std::string& file);

  /// As parse(). Fails too when the file cannot be read or is larger than 256 MB.
  [[nodiscard]] static Result<HandTrajectory> read(const std::filesystem::path& file);

  /// X_WH at the time `t` [s].
  [[nodiscard]] Pose poseAt(double t) const noexcept;
  /// Line of the row that the pose at the time `t` [s] starts from: the newest one up to then, or the first.
  [[nodiscard]] std::size_t lineAt(double t) const noexcept { return rowAt(t).line; }
  /// [s] Time of the last row.
  [[nodiscard]] double end() const noexcept { return rows_.back().t; }

 private:
  struct Row {
    double t = 0.0;  // [s]
    Pose X_WH;
    std::size_t line = 0;
  };

  [[nodiscard]] const Row& rowAt(double t) const noexcept;  // `t` [s]
  [[nodiscard]] static Result<Row> parseRow(std::string_view text);

  std::vector<Row> rows_;  // at least one, by rising time
};

}  // namespace tenon::station
