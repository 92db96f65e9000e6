#include "tests/bench/engine/methods.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "tests/bench/engine/held_box.h"
#include "tests/bench/engine/timing.h"

namespace tenon::bench {
namespace {

constexpr double kMethodVoxel = 0.003;  // [m]
constexpr double kDilation = HeldBox::dilationOf(kMethodVoxel);
constexpr int kMethodTicks = 300;
constexpr int kSheets = 8;

/// Results of one contact method.
struct MethodFigures {
  int sheets_passed = 0;          ///< of kSheets without thickness; the hand ends 50 mm behind them
  double sheet_overlap = 0.0;     ///< [m] largest penetration of a sheet's dilated surface
  double corner_overlap = 0.0;    ///< [m] likewise, pressed at an angle into a concave corner
  double slide_lag = 0.0;         ///< [m] largest distance to the hand along a floor, at 0.5 m/s
  double force_step = 0.0;        ///< [N] largest change per tick while sliding
  double rest_force_range = 0.0;  ///< [N] largest minus smallest force on a hand at rest in the corner
  Percentiles tick;               ///< [us] while sliding
};

void measureSheets(collision::ContactMethod method, MethodFigures& figures) {
  for (int i = 0; i < kSheets; ++i) {
    const double offset = kMethodVoxel * i / kSheets;
    const Pose X_WH(Vector3(0.0, 0.0, 0.05), expRotation({0.17, 0.05, 0.0}));
    HeldBox held(method, test::sheetStructures(0.3, 0.0, kMethodVoxel, offset), kDilation, X_WH);
    for (int tick = 0; tick < kMethodTicks; ++tick) {
      const double z = std::max(0.05 - 0.001 * tick, -0.05);
      held.step(Pose(Vector3(0.0, 0.0, z), X_WH.rotation()));
    }
    if (held.pose().translation().z() < offset) ++figures.sheets_passed;
    figures.sheet_overlap = std::max(figures.sheet_overlap, held.overlap());
  }
}

void measureCorner(collision::ContactMethod method, MethodFigures& figures) {
  const Pose start(Vector3(0.08, 0.07, 0.06), expRotation({0.05, 0.03, 0.0}));
  HeldBox held(method, test::cornerStructures(0.3, kMethodVoxel), kDilation, start);
  for (int tick = 0; tick < kMethodTicks; ++tick) {
    const double depth = std::min(0.0005 * tick, 0.06);
    held.step(Pose(start.translation() - Vector3(depth, depth, depth), start.rotation()));
  }
  double smallest = held.force().norm();
  double largest = smallest;
  for (int tick = 0; tick < kMethodTicks; ++tick) {
    held.step(Pose(start.translation() - Vector3::Constant(0.06), start.rotation()));
    smallest = std::min(smallest, held.force().norm());
    largest = std::max(largest, held.force().norm());
  }
  figures.corner_overlap = held.overlap();
  figures.rest_force_range = largest - smallest;
}

void measureSlide(collision::ContactMethod method, MethodFigures& figures) {
  const double height = 0.02 + kDilation;
  // [m] below the surface: 1 mm for the penalty force, which acts only where the box penetrates, 10 mm
  // otherwise
  const double press_depth = method == collision::ContactMethod::kPenalty ? 0.001 : 0.01;
  const auto handAt = [&](int tick) { return Vector3(-0.07 + 0.0005 * tick, 0.003, height - press_depth); };
  HeldBox held(method, test::floorStructures(0.4, kMethodVoxel), kDilation,
               Pose(handAt(0) + 2.0 * press_depth * Vector3::UnitZ()));
  for (int tick = 0; tick < 50; ++tick) held.step(Pose(handAt(0)));
  Vector3 before = held.force();
  std::vector<double> times;
  for (int tick = 1; tick <= kMethodTicks; ++tick) {
    times.push_back(microsecondsOf([&] { held.step(Pose(handAt(tick))); }));
    figures.slide_lag =
        std::max(figures.slide_lag, (handAt(tick) - held.pose().translation()).head<2>().norm());
    figures.force_step = std::max(figures.force_step, (held.force() - before).norm());
    before = held.force();
  }
  figures.tick = percentilesOf(std::move(times));
}

MethodFigures measure(collision::ContactMethod method) {
  MethodFigures figures;
  measureSheets(method, figures);
  measureCorner(method, figures);
  measureSlide(method, figures);
  return figures;
}

}  // namespace

Table methodsTable(const ProgressCallback& progress) {
  Table table;
  table.name = "methods";
  table.title = "God object, blocking heuristic and penalty force of the paper, in the same scenes (item 5)";
  table.columns = {"method",       "sheets passed", "sheet overlap mm", "corner overlap mm",
                   "slide lag mm", "force step N",  "rest force N",     "median us",
                   "p99 us"};
  table.notes = {
      fmt::format("sheets passed: of {} sheets without thickness, by hands that end 50 mm behind them",
                  kSheets),
      "overlap: largest penetration of the dilated surface; corner: pressed at an angle into a concave "
      "corner",
      "slide lag and force step: along a floor at 0.5 m/s; rest force: range of the force on a hand at rest "
      "in the corner"};
  using enum collision::ContactMethod;
  for (const auto& [method, name] :
       {std::pair(kIsland, "god object"), std::pair(kBlocking, "blocking"), std::pair(kPenalty, "penalty")}) {
    progress(std::string("methods: ") + name);
    const MethodFigures figures = measure(method);
    table.rows.push_back({name, static_cast<double>(figures.sheets_passed), 1e3 * figures.sheet_overlap,
                          1e3 * figures.corner_overlap, 1e3 * figures.slide_lag, figures.force_step,
                          figures.rest_force_range, figures.tick.median, figures.tick.p99});
  }
  return table;
}

}  // namespace tenon::bench
