#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/messages/log.h"
#include "idl/types/spatial.h"
#include "server/game_control/scenario.h"

namespace tenon::check {

enum class FindingKind : std::uint8_t {
  kLoad,       ///< the scenario cannot be loaded
  kOverlap,    ///< two objects are inside each other, at the start or at a target
  kClearance,  ///< play between a part at its target and what it fits into
  kScale,      ///< a size that cannot be: most likely a wrong unit
  kApproach,   ///< something stands in the way of an approach
  kReach,      ///< an object is out of reach
  kTurning,    ///< more turning than the device has
  kOpen,       ///< surface that a part may pass
  kFilled,     ///< empty space that is solid in the field
};

/// What a check found. Objects may be invalid, where none is concerned.
struct Finding {
  FindingKind kind = FindingKind::kLoad;
  Severity severity = Severity::kError;  ///< kInfo: a note
  ObjectId object;
  ObjectId other;
  std::string state;            ///< its name; empty: of the start
  int line = 0;                 ///< in the scenario file; 0: none
  std::optional<Vector3> p_WP;  ///< where
  double value = 0.0;           ///< [m] or [rad] or [-], see `unit`
  std::string_view unit;        ///< of `value`: m, rad; empty: a ratio
  double error = 0.0;  ///< [m] or [rad] or [-] of `value`, at most; 0: it is as exact as it is written
  std::string text;    ///< one sentence, with the titles of the objects
  std::string hint;    ///< what helps; may be empty
};

/// "overlap"
[[nodiscard]] std::string_view nameOf(FindingKind kind);
/// "error", "warning" or "note"
[[nodiscard]] std::string_view nameOf(Severity severity);

/// Number of findings of a severity.
[[nodiscard]] std::size_t countOf(const std::vector<Finding>& findings, Severity severity);

/// One line for a terminal or a log: `FILE:LINE: error: SENTENCE (HINT)`.
[[nodiscard]] std::string lineOf(const game_control::ScenarioFile& scenario, const Finding& finding);

}  // namespace tenon::check
