#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "server/collision/island_solver.h"
#include "tests/bench/engine/timing.h"

namespace tenon::bench {

/// What one way to keep a held body out of others does in the same scenes as the other ways.
struct MethodFigures {
  std::string_view method;
  int sheets_passed = 0;           ///< of kSheets: the hand ends 50 mm behind a sheet of no thickness
  double sheet_overlap = 0.0;      ///< [m] the deepest in the field that stands for it, dilation included
  double corner_overlap = 0.0;     ///< [m] likewise, pressed askew into an inner corner
  double slide_lag = 0.0;          ///< [m] behind the hand, along a floor at 0.5 m/s
  double force_step = 0.0;         ///< [N] the largest change from tick to tick while it slides
  double still_force_range = 0.0;  ///< [N] of the force on a hand that holds still in the corner
  Percentiles tick;                ///< [us] of the slide
};

inline constexpr int kSheets = 8;

/// The god object, then the paper's blocking heuristic and its penalty force. Takes some seconds; counted
/// figures are the same on every machine.
[[nodiscard]] std::vector<MethodFigures> compareMethods();
[[nodiscard]] MethodFigures measureMethod(ContactMethod method);

/// As text, a line each, with a heading.
[[nodiscard]] std::string methodTable(const std::vector<MethodFigures>& methods);

}  // namespace tenon::bench
