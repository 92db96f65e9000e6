#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include <yaml-cpp/yaml.h>

#include "idl/types/result.h"
#include "idl/types/spatial.h"

namespace tenon {

/// What a number with a unit measures; without a unit it is SI. Angles need one: a bare 2 could be either.
enum class Quantity : std::uint8_t {
  kLength,
  kAngle,
  kTime,
  kForce,
  kStiffness,
  kRotationalStiffness,
  kMass,
  kDensity,
  kPlain
};

/// Reads typed values from YAML and remembers the first thing that was wrong, with its line.
///
/// After a failure it goes on and gives defaults, so that whoever reads a file needs no branch behind every
/// value and asks once at the end. Nodes must be `const`: yaml-cpp inserts what is looked up in others.
///
/// Threads: one. Real-time: no.
class YamlReader {
 public:
  explicit YamlReader(std::string file) : file_(std::move(file)) {}

  /// `at` tells the line; a node without one (a missing value) is placed at the last mapping that was opened.
  void fail(const YAML::Node& at, const std::string& what) { failAt(lineOf(at), what); }
  void failAt(int line, const std::string& what);
  [[nodiscard]] bool failed() const { return error_.has_value(); }
  [[nodiscard]] Error error() const { return *error_; }
  [[nodiscard]] int lineOf(const YAML::Node& node) const;

  /// Is it a mapping with only the keys of that ScenarioMapping, each once? `what` names it: "an object".
  bool openMapping(const YAML::Node& node, std::string_view mapping, const std::string& what);
  /// Is it a list, of at most `most` entries?
  bool isList(const YAML::Node& node, const std::string& what, std::size_t most = 1000);

  [[nodiscard]] std::string text(const YAML::Node& node, const std::string& what);
  [[nodiscard]] bool yesNo(const YAML::Node& node, const std::string& what, bool when_missing);
  [[nodiscard]] std::int64_t integer(const YAML::Node& node, const std::string& what, std::int64_t least,
                                     std::int64_t most, std::int64_t when_missing);
  /// In SI. Fails outside [least, most].
  [[nodiscard]] double number(const YAML::Node& node, Quantity quantity, const std::string& what,
                              double least, double most);
  /// The same, `when_missing` when there is no such key.
  [[nodiscard]] double numberOr(const YAML::Node& node, Quantity quantity, const std::string& what,
                                double least, double most, double when_missing);
  [[nodiscard]] Vector3 vector(const YAML::Node& node, Quantity quantity, const std::string& what);
  /// Of a mapping with `at` and `turn` or `q`; it has been opened by the caller.
  [[nodiscard]] Pose pose(const YAML::Node& mapping, const std::string& what);

 private:
  [[nodiscard]] Quaternion turned(const YAML::Node& turns, const std::string& what);
  [[nodiscard]] Quaternion turn(const YAML::Node& node, const std::string& what);

  std::string file_;
  std::optional<Error> error_;
  int last_line_ = 1;
};

}  // namespace tenon
