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

constexpr double kMethodVoxel = 0.003;
constexpr double kDilation = HeldBox::dilationOf(kMethodVoxel);
constexpr int kMethodTicks = 300;
constexpr int kSheets = 8;

/// What one way to keep a held body out of others does.
struct MethodFigures {
  int sheets_passed = 0;           ///< of kSheets: the hand ends 50 mm behind a sheet of no thickness
  double sheet_overlap = 0.0;      ///< [m] the deepest in the field that stands for it, dilation included
  double corner_overlap = 0.0;     ///< [m] likewise, pressed askew into an inner corner
  double slide_lag = 0.0;          ///< [m] behind the hand, along a floor at 0.5 m/s
  double force_step = 0.0;         ///< [N] the largest change from tick to tick while it slides
  double still_force_range = 0.0;  ///< [N] of the force on a hand that holds still in the corner
  Percentiles tick;                ///< [us] of the slide
};

void measureSheets(ContactMethod method, MethodFigures& figures) {
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

void measureCorner(ContactMethod method, MethodFigures& figures) {
  const Pose start(Vector3(0.08, 0.07, 0.06), expRotation({0.05, 0.03, 0.0}));
  HeldBox held(method, test::cornerStructures(0.3, kMethodVoxel), kDilation, start);
  for (int tick = 0; tick < kMethodTicks; ++tick) {
    const double way = std::min(0.0005 * tick, 0.06);
    held.step(Pose(start.translation() - Vector3(way, way, way), start.rotation()));
  }
  double least = held.force().norm();
  double most = least;
  for (int tick = 0; tick < kMethodTicks; ++tick) {
    held.step(Pose(start.translation() - Vector3::Constant(0.06), start.rotation()));
    least = std::min(least, held.force().norm());
    most = std::max(most, held.force().norm());
  }
  figures.corner_overlap = held.overlap();
  figures.still_force_range = most - least;
}

void measureSlide(ContactMethod method, MethodFigures& figures) {
  const double height = 0.02 + kDilation;
  // penalties hold the box by overlap: there the hand presses a millimetre, elsewhere ten
  const double press = method == ContactMethod::kPenalty ? 0.001 : 0.01;
  const auto handAt = [&](int tick) { return Vector3(-0.07 + 0.0005 * tick, 0.003, height - press); };
  HeldBox held(method, test::floorStructures(0.4, kMethodVoxel), kDilation,
               Pose(handAt(0) + 2.0 * press * Vector3::UnitZ()));
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

MethodFigures measure(ContactMethod method) {
  MethodFigures figures;
  measureSheets(method, figures);
  measureCorner(method, figures);
  measureSlide(method, figures);
  return figures;
}

}  // namespace

Table methodsTable(const Say& say) {
  Table table;
  table.name = "methods";
  table.title =
      "God object, and the paper's blocking heuristic and penalty force, in the same scenes (item 5)";
  table.columns = {"method",       "sheets passed", "sheet overlap mm", "corner overlap mm",
                   "slide lag mm", "force step N",  "still force N",    "median us",
                   "p99 us"};
  table.notes = {
      fmt::format("sheets passed: of {} of no thickness, with hands that end 50 mm behind them", kSheets),
      "overlap: the deepest in the dilated field; corner: pressed askew into an inner corner",
      "slide lag and force step: along a floor at 0.5 m/s; still force: its range while a hand stands in the "
      "corner"};
  using enum ContactMethod;
  for (const auto& [method, name] :
       {std::pair(kIsland, "god object"), std::pair(kBlocking, "blocking"), std::pair(kPenalty, "penalty")}) {
    say(std::string("methods: ") + name);
    const MethodFigures one = measure(method);
    table.rows.push_back({name, static_cast<double>(one.sheets_passed), 1e3 * one.sheet_overlap,
                          1e3 * one.corner_overlap, 1e3 * one.slide_lag, one.force_step,
                          one.still_force_range, one.tick.median, one.tick.p99});
  }
  return table;
}

}  // namespace tenon::bench
