#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include <yaml-cpp/yaml.h>

#include "idl/types/result.h"
#include "idl/types/spatial.h"

namespace tenon::game_control {

/// What a number measures, which decides the units that may follow it. A number without a unit is in SI;
/// angles need a unit, because a bare 2 could be degrees or radians.
enum class Quantity : std::uint8_t {
  kLength,
  kAngle,
  kTime,
  kForce,
  kStiffness,
  kRotationalStiffness,
  kMass,
  kDensity,
  kPlain  ///< takes no unit
};

/// Reads typed values from YAML and keeps the first error, with its line.
///
/// After an error it returns defaults, so that callers need no branch after each value and check failed()
/// once at the end. Nodes must be `const`: operator[] of a mutable yaml-cpp node inserts missing keys.
///
/// `what` describes the value in errors: "'within' of a force condition".
///
/// Threads: one. Real-time: no.
class YamlReader {
 public:
  /// `file` is the name of the file in errors.
  explicit YamlReader(std::string file) : file_(std::move(file)) {}

  /// The line is that of `at`; for a node without one (a missing value) that of the last mapping opened.
  void fail(const YAML::Node& at, const std::string& what) { failAt(lineOf(at), what); }
  void failAt(int line, const std::string& what);
  [[nodiscard]] bool failed() const { return error_.has_value(); }
  [[nodiscard]] Error error() const { return *error_; }    ///< only when failed()
  [[nodiscard]] int lineOf(const YAML::Node& node) const;  ///< from 1

  /// Checks that the node is a mapping with only the keys of that ScenarioMapping, each at most once.
  bool openMapping(const YAML::Node& node, std::string_view mapping, const std::string& what);
  /// Checks that the node is a list of at most `max_size` entries.
  bool checkList(const YAML::Node& node, const std::string& what, std::size_t max_size = 1000);

  [[nodiscard]] std::string text(const YAML::Node& node, const std::string& what);
  /// Of at most `most` bytes.
  [[nodiscard]] std::string text(const YAML::Node& node, const std::string& what, std::size_t most);
  [[nodiscard]] bool boolean(const YAML::Node& node, const std::string& what, bool default_value);
  [[nodiscard]] std::int64_t integer(const YAML::Node& node, const std::string& what, std::int64_t min,
                                     std::int64_t max, std::int64_t default_value);
  /// In SI units. An error outside of `min` [SI] to `max` [SI].
  [[nodiscard]] double number(const YAML::Node& node, Quantity quantity, const std::string& what, double min,
                              double max);
  /// As number(), with `min` [SI] and `max` [SI]; `default_value` [SI] when the key is missing.
  [[nodiscard]] double numberOr(const YAML::Node& node, Quantity quantity, const std::string& what,
                                double min, double max, double default_value);
  /// Three numbers, each within +-1e6 in SI units.
  [[nodiscard]] Vector3 vector(const YAML::Node& node, Quantity quantity, const std::string& what);
  /// From a mapping with `at` and `turn` or `q` that the caller has opened; what is missing is the identity.
  [[nodiscard]] Pose pose(const YAML::Node& mapping, const std::string& what);

 private:
  [[nodiscard]] Quaternion rotations(const YAML::Node& turns, const std::string& what);
  [[nodiscard]] Quaternion rotation(const YAML::Node& turn, const std::string& what);

  std::string file_;
  std::optional<Error> error_;
  int last_line_ = 1;  ///< of the last mapping opened
};

}  // namespace tenon::game_control
