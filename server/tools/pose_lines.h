#pragma once

#include <cmath>
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include "idl/types/spatial.h"
#include "server/tools/number_lines.h"

namespace tenon::tools {

/// The poses of a text file, one per line: `x y z qw qx qy qz`, in metres. An error when the file has none,
/// or a quaternion's norm differs from 1 by more than 1 %.
[[nodiscard]] inline Result<std::vector<Pose>> readPoses(const std::string& file) {
  std::ifstream in(file);
  if (!in) return fail(file + ": cannot be read");
  NumberLines lines(in, file, 7);
  std::vector<Pose> poses;
  while (true) {
    const auto more = lines.next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    const std::vector<double>& n = lines.numbers();
    const Quaternion q(n[3], n[4], n[5], n[6]);
    // tolerates rounding to few digits
    if (std::abs(q.norm() - 1.0) > 0.01) {
      char length[32];
      std::snprintf(length, sizeof length, "%.4g", q.norm());
      return fail(lines.position() + ": qw qx qy qz is not a unit quaternion (its length is " + length + ")");
    }
    poses.emplace_back(Vector3(n[0], n[1], n[2]), q.normalized());
  }
  if (poses.empty()) return fail(file + ": has no poses");
  return poses;
}

}  // namespace tenon::tools
