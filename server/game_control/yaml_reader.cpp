#include "server/game_control/yaml_reader.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <set>
#include <span>
#include <vector>

#include <fmt/format.h>

#include "server/game_control/quantity_text.h"
#include "server/game_control/scenario_keys.h"

namespace tenon::game_control {
namespace {

struct UnitFactor {
  std::string_view name;
  double si;  ///< [SI unit] one of this unit
};

constexpr std::array kLengths{UnitFactor{"m", 1.0}, UnitFactor{"mm", 1e-3}, UnitFactor{"cm", 1e-2},
                              UnitFactor{"in", 0.0254}};
constexpr std::array kAngles{UnitFactor{"deg", kDegree}, UnitFactor{"rad", 1.0}};
constexpr std::array kTimes{UnitFactor{"s", 1.0}, UnitFactor{"ms", 1e-3}, UnitFactor{"min", 60.0}};
constexpr std::array kForces{UnitFactor{"N", 1.0}};
constexpr std::array kStiffnesses{UnitFactor{"N/m", 1.0}, UnitFactor{"N/mm", 1e3}};
constexpr std::array kRotationalStiffnesses{UnitFactor{"Nm/rad", 1.0}};
constexpr std::array kMasses{UnitFactor{"kg", 1.0}, UnitFactor{"g", 1e-3}};
constexpr std::array kDensities{UnitFactor{"kg/m3", 1.0}, UnitFactor{"g/cm3", 1e3}};

std::span<const UnitFactor> unitsOf(Quantity quantity) {
  switch (quantity) {
    case Quantity::kLength:
      return kLengths;
    case Quantity::kAngle:
      return kAngles;
    case Quantity::kTime:
      return kTimes;
    case Quantity::kForce:
      return kForces;
    case Quantity::kStiffness:
      return kStiffnesses;
    case Quantity::kRotationalStiffness:
      return kRotationalStiffnesses;
    case Quantity::kMass:
      return kMasses;
    case Quantity::kDensity:
      return kDensities;
    case Quantity::kPlain:
      break;
  }
  return {};
}

std::string_view exampleText(Quantity quantity) {
  switch (quantity) {
    case Quantity::kLength:
      return "a length such as 2 mm or 0.5 m";
    case Quantity::kAngle:
      return "an angle with its unit such as 2 deg";
    case Quantity::kTime:
      return "a time such as 1 s or 200 ms";
    case Quantity::kForce:
      return "a force such as 5 N";
    case Quantity::kStiffness:
      return "a stiffness such as 1000 N/m";
    case Quantity::kRotationalStiffness:
      return "a stiffness such as 20 Nm/rad";
    case Quantity::kMass:
      return "a mass such as 0.4 kg or 250 g";
    case Quantity::kDensity:
      return "a density such as 2700 kg/m3 or 2.7 g/cm3";
    case Quantity::kPlain:
      break;
  }
  return "a number";
}

std::string shortened(const std::string& text) {
  constexpr std::size_t kLongest = 40;
  if (text.size() <= kLongest) return text;
  return fmt::format("{}...", std::string_view(text).substr(0, kLongest));
}

std::string formatted(double number) {
  std::array<char, 32> buffer{};
  const auto end =
      std::to_chars(buffer.data(), buffer.data() + buffer.size(), number, std::chars_format::general, 6);
  return {buffer.data(), end.ptr};
}

/// "2 mm" in SI; empty when it is no number, or its unit is unknown or missing.
std::optional<double> parsed(std::string_view text, Quantity quantity) {
  double number = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || !std::isfinite(number)) return std::nullopt;
  std::string_view unit(end, static_cast<std::size_t>(text.data() + text.size() - end));
  while (!unit.empty() && unit.front() == ' ') unit.remove_prefix(1);
  if (unit.empty()) return quantity == Quantity::kAngle ? std::nullopt : std::optional(number);
  for (const UnitFactor& known : unitsOf(quantity)) {
    if (known.name == unit) return number * known.si;
  }
  return std::nullopt;
}

}  // namespace

void YamlReader::failAt(int line, const std::string& what) {
  if (!error_) error_ = Error{file_ + ":" + std::to_string(line) + ": " + what};
}

int YamlReader::lineOf(const YAML::Node& node) const {
  if (!node.IsDefined() || node.Mark().is_null()) return last_line_;
  return node.Mark().line + 1;
}

bool YamlReader::openMapping(const YAML::Node& node, std::string_view mapping, const std::string& what) {
  if (!node.IsDefined() || !node.IsMap()) {
    fail(node, what + " must be a mapping (key: value)");
    return false;
  }
  last_line_ = lineOf(node);
  const std::span<const std::string_view> keys = scenarioMapping(mapping).keys;
  std::set<std::string> seen;
  for (const auto& entry : node) {
    if (!entry.first.IsScalar()) {
      fail(entry.first, what + " has a key that is not a scalar");
      return false;
    }
    const std::string& key = entry.first.Scalar();
    if (!seen.insert(key).second) {
      fail(entry.first, what + " has two keys '" + shortened(key) + "'");
      return false;
    }
    if (std::find(keys.begin(), keys.end(), key) != keys.end()) continue;
    if (const std::string_view now = renamedKey(mapping, key); !now.empty()) {
      fail(entry.first,
           what + " has a key with an old name: '" + key + "' is now '" + std::string(now) + "'");
      return false;
    }
    if (const std::string_view instead = removedKey(mapping, key); !instead.empty()) {
      fail(entry.first, what + " has the key '" + key + "', which is no more: " + std::string(instead));
      return false;
    }
    const std::string hint = suggestion(key, keys);
    std::string known;
    for (const std::string_view one : keys) known += (known.empty() ? "" : ", ") + std::string(one);
    fail(entry.first, what + " has an unknown key '" + shortened(key) + "'; " +
                          (hint.empty() ? "known keys: " + known : hint));
    return false;
  }
  return true;
}

bool YamlReader::checkList(const YAML::Node& node, const std::string& what, std::size_t max_size) {
  if (!node.IsDefined() || !node.IsSequence()) {
    fail(node, what + " must be a list");
    return false;
  }
  if (node.size() > max_size) {
    fail(node, what + " has " + std::to_string(node.size()) + " entries, at most " +
                   std::to_string(max_size) + " are allowed");
    return false;
  }
  return true;
}

std::string YamlReader::text(const YAML::Node& node, const std::string& what) {
  if (!node.IsDefined()) {
    fail(node, what + " is missing");
    return {};
  }
  if (!node.IsScalar() || node.Scalar().empty()) {
    fail(node, what + " must be a text");
    return {};
  }
  return node.Scalar();
}

std::string YamlReader::text(const YAML::Node& node, const std::string& what, std::size_t most) {
  std::string read = text(node, what);
  if (read.size() <= most) return read;
  fail(node, what + " has " + std::to_string(read.size()) + " bytes, at most " + std::to_string(most) +
                 " can be sent: shorten it (letters beyond ASCII take two or more)");
  return {};
}

bool YamlReader::boolean(const YAML::Node& node, const std::string& what, bool default_value) {
  if (!node.IsDefined()) return default_value;
  bool value = default_value;
  if (!node.IsScalar() || !YAML::convert<bool>::decode(node, value))
    fail(node, what + " must be true or false");
  return value;
}

std::int64_t YamlReader::integer(const YAML::Node& node, const std::string& what, std::int64_t min,
                                 std::int64_t max, std::int64_t default_value) {
  if (!node.IsDefined()) return default_value;
  std::int64_t value = 0;
  if (node.IsScalar()) {
    const std::string& word = node.Scalar();
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error == std::errc{} && end == word.data() + word.size() && value >= min && value <= max)
      return value;
  }
  fail(node, what + " must be a whole number between " + std::to_string(min) + " and " + std::to_string(max));
  return default_value;
}

double YamlReader::number(const YAML::Node& node, Quantity quantity, const std::string& what, double min,
                          double max) {
  if (!node.IsDefined()) {
    fail(node, what + " is missing, expected " + std::string(exampleText(quantity)));
    return min;
  }
  const std::optional<double> value = node.IsScalar() ? parsed(node.Scalar(), quantity) : std::nullopt;
  if (!value) {
    fail(node, what + (node.IsScalar() ? " is '" + shortened(node.Scalar()) + "'" : " is not a number") +
                   ", expected " + std::string(exampleText(quantity)));
    return min;
  }
  if (*value < min || *value > max) {
    const std::string_view unit = unitsOf(quantity).empty()      ? ""
                                  : quantity == Quantity::kAngle ? "rad"
                                                                 : unitsOf(quantity)[0].name;
    fail(node, what + " is " + shortened(node.Scalar()) + ", expected between " + formatted(min) + " and " +
                   formatted(max) + (unit.empty() ? "" : " " + std::string(unit)));
    return min;
  }
  return *value;
}

double YamlReader::numberOr(const YAML::Node& node, Quantity quantity, const std::string& what, double min,
                            double max, double default_value) {
  return node.IsDefined() ? number(node, quantity, what, min, max) : default_value;
}

Vector3 YamlReader::vector(const YAML::Node& node, Quantity quantity, const std::string& what) {
  Vector3 v = Vector3::Zero();
  if (!node.IsDefined() || !node.IsSequence() || node.size() != 3) {
    fail(node, what + " must be a list of three numbers [x, y, z]");
    return v;
  }
  constexpr double kLargest = 1e6;
  for (int i = 0; i < 3; ++i) v[i] = number(node[i], quantity, what, -kLargest, kLargest);
  return v;
}

Pose YamlReader::pose(const YAML::Node& mapping, const std::string& what) {
  Pose X;
  const YAML::Node at = mapping["at"];
  const YAML::Node turns = mapping["turn"];
  const YAML::Node q = mapping["q"];
  if (at.IsDefined()) X.translation() = vector(at, Quantity::kLength, "'at' of " + what);
  if (turns.IsDefined() && q.IsDefined()) {
    fail(q, what + " has both 'turn' and 'q', expected one of them");
  } else if (turns.IsDefined()) {
    X.rotation() = rotations(turns, what);
  } else if (q.IsDefined()) {
    if (!q.IsSequence() || q.size() != 4) {
      fail(q, "'q' of " + what + " must be a list of four numbers [w, x, y, z]");
      return X;
    }
    std::array<double, 4> wxyz{};
    for (std::size_t i = 0; i < 4; ++i) wxyz[i] = number(q[i], Quantity::kPlain, "'q' of " + what, -1e3, 1e3);
    const Quaternion given(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
    constexpr double kUnitWithin = 0.01;  // [-] a typed quaternion has two or three digits
    if (std::abs(given.norm() - 1.0) > kUnitWithin) {
      fail(q, "'q' of " + what + " has length " + formatted(given.norm()) +
                  ", expected a unit quaternion [w, x, y, z]");
      return X;
    }
    X.rotation() = given.normalized();
  }
  return X;
}

Quaternion YamlReader::rotations(const YAML::Node& turns, const std::string& what) {
  if (!turns.IsSequence()) return rotation(turns, what);
  Quaternion q = Quaternion::Identity();
  if (!checkList(turns, "'turn' of " + what, 8)) return q;
  for (const auto& one : turns) q = (rotation(one, what) * q).normalized();
  return q;
}

Quaternion YamlReader::rotation(const YAML::Node& node, const std::string& what) {
  if (!openMapping(node, "turn", "'turn' of " + what)) return Quaternion::Identity();
  Vector3 axis = Vector3::Zero();
  const YAML::Node given = node["axis"];
  const std::string letter = given.IsDefined() && given.IsScalar() ? given.Scalar() : "";
  if (letter == "x" || letter == "y" || letter == "z") {
    axis[letter[0] - 'x'] = 1.0;
  } else {
    axis = vector(given, Quantity::kPlain, "'axis' of 'turn' of " + what);
  }
  const double degrees = number(node["deg"], Quantity::kPlain, "'deg' of 'turn' of " + what, -360.0, 360.0);
  if (failed()) return Quaternion::Identity();
  if (axis.norm() < 1e-9) {
    fail(given, "'axis' of 'turn' of " + what + " has length 0");
    return Quaternion::Identity();
  }
  // expRotation takes at most half a turn
  const double within_half_turn = degrees > 180.0    ? degrees - 360.0
                                  : degrees < -180.0 ? degrees + 360.0
                                                     : degrees;
  return expRotation(axis.normalized() * (within_half_turn * kDegree));
}

}  // namespace tenon::game_control
