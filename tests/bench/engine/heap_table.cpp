#include "tests/bench/engine/heap_table.h"

#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "tests/bench/engine/timing.h"
#include "tests/server/simulation/small_scene.h"

namespace tenon::bench {
namespace {

constexpr int kTicks = 450;
constexpr double kEdge = 0.05;     // [m]
constexpr double kMass = 0.4;      // [kg]
constexpr double kFriction = 0.4;  // [-]
constexpr int kWallWidth = 5;

/// A scene of free boxes and a floor; all may collide with each other.
class FreeBoxes {
 public:
  FreeBoxes() : floor_(small_.object("floor", test::floorShape(), Vector3::Zero())) {}

  void add(const Pose& X_WO) {
    const ObjectId box = small_.freeBox(fmt::format("box {}", boxes_.size()), Vector3::Constant(kEdge), kMass,
                                        X_WO.translation());
    small_.spec(box).X_WO = X_WO;
    small_.spec(box).body->friction = kFriction;
    small_.pair(box, floor_);
    for (const ObjectId other : boxes_) small_.pair(box, other);
    boxes_.push_back(box);
  }
  [[nodiscard]] std::shared_ptr<const simulation::Scene> scene() const { return small_.build(); }

 private:
  test::SmallScene small_;
  ObjectId floor_;
  std::vector<ObjectId> boxes_;
};

/// Deterministic value in [-1, 1) for each number (golden ratio sequence).
double hashed(int number) {
  const double turns = 0.618034 * number;
  return 2.0 * (turns - std::floor(turns)) - 1.0;
}

/// Layers of five, each box on two, released 0.1 mm above each other. The ends are unsupported and collapse.
FreeBoxes wall(int count) {
  FreeBoxes boxes;
  for (int i = 0; i < count; ++i) {
    const int layer = i / kWallWidth;
    const double x = (i % kWallWidth + 0.5 * (layer % 2) - 0.5 * kWallWidth) * (kEdge + 0.001);
    boxes.add(Pose(Vector3(x, 0.0005 * hashed(i), (layer + 0.5) * kEdge + 1e-4 * (layer + 1))));
  }
  return boxes;
}

/// Layers of four or nine, dropped with different orientations.
FreeBoxes heap(int count) {
  FreeBoxes boxes;
  const int side = count <= 20 ? 2 : 3;
  for (int i = 0; i < count; ++i) {
    const int slot = i % (side * side);
    const Vector3 p(0.066 * (slot % side - 0.5 * (side - 1)), 0.066 * (slot / side - 0.5 * (side - 1)),
                    0.045 + 0.07 * (i / (side * side)));
    const Vector3 turn(hashed(3 * i), hashed(3 * i + 1), hashed(3 * i + 2));
    boxes.add(Pose(p, expRotation(0.25 * turn)));
  }
  return boxes;
}

std::vector<TableCell> row(const char* name, int count, const FreeBoxes& boxes) {
  simulation::Environment environment(boxes.scene(), {});
  std::vector<double> times;
  double queries = 0.0;
  double steps = 0.0;
  double iterations = 0.0;
  for (int i = 0; i < kTicks; ++i) {
    times.push_back(microsecondsOf([&] { environment.step(); }));
    queries += environment.work().queried_pairs;
    steps += environment.work().steps;
    iterations += environment.work().iterations;
  }
  const Percentiles times_us = percentilesOf(std::move(times));
  return {name,           static_cast<double>(count), queries / kTicks,
          steps / kTicks, iterations / kTicks,        times_us.median,
          times_us.p99};
}

}  // namespace

Table heapsTable(const ProgressCallback& progress) {
  Table table;
  table.name = "heaps";
  table.title = "Whole ticks while free boxes settle on each other (item 9)";
  table.columns = {"arrangement", "boxes", "queried pairs", "SQP steps", "iterations", "median us", "p99 us"};
  table.notes = {
      fmt::format("boxes of {:.0f} mm, the first {} ticks after release, one worker; "
                  "queried pairs, SQP steps, iterations: per tick",
                  1000.0 * kEdge, kTicks)};
  for (const int count : {10, 20, 40}) {
    progress(fmt::format("heaps of {} boxes", count));
    table.rows.push_back(row("heap", count, heap(count)));
    table.rows.push_back(row("wall", count, wall(count)));
  }
  return table;
}

}  // namespace tenon::bench
