#include "clients/simulated_person/assembly_behavior.h"

#include <algorithm>
#include <string>

#include <gtest/gtest.h>

namespace tenon::simulated_person {
namespace {

constexpr double kDt = 1e-3;  // [s]
constexpr ObjectId kPart{0};
const Vector3 p_WTarget(0.2, 0.1, 0.0);  // of the part's origin
constexpr double kOpening = 0.006;       // [m] radius about the target in which the part enters a plate
constexpr double kPlate = 0.04;          // [m] level of the plate's upper face, which stops the part's origin
constexpr double kStiffness = 2000.0;    // [N/m] of the coupling between hand and part

/// A person who carries a part to a hole in a plate from above. The part's frame is the hand's.
class Plate {
 public:
  Plate() : behavior_({}, 1) {
    SceneObject part;
    part.object = kPart;
    part.X_WO = Pose(Vector3(0.0, 0.0, 0.3));
    part.size = Vector3::Constant(0.02);
    const SceneObject objects[] = {part};
    world_.begin(objects, 1, 0);
    perception_.begin(1, 150);
    X_WH_ = X_WO_ = part.X_WO;
    behavior_.begin(X_WH_);
    planner_.begin({});
    MountTask task;
    task.object = kPart;
    task.X_WG = Pose(p_WTarget);
    task.approach_W = -Vector3::UnitZ();
    task.approach_distance = 0.15;
    task.size = part.size;
    behavior_.mount(hand(), planner_, task);
  }

  /// `frozen`: neither hand nor part move, as when the server holds the hand still.
  void run(double seconds, bool frozen = false) {
    for (int i = 0; i < seconds / kDt; ++i) {
      behavior_.step(hand(), perception_, kDt);
      if (!frozen) {
        X_WH_ = behavior_.intendedPose();
        place(X_WH_.translation());
      }
      WorldFrame frame;
      frame.server_epoch = 1;
      frame.tick = ++tick_;
      ObjectState state;
      state.object = kPart;
      state.X_WO = X_WO_;
      frame.states.push_back(state);
      world_.receive(frame);
      perception_.record(world_);
    }
  }
  /// Until the person does `activity`, for 60 s at most.
  [[nodiscard]] bool runUntil(const std::string& activity) {
    for (int i = 0; i < 60000 && activity != behavior_.activity(); ++i) run(kDt);
    return activity == behavior_.activity();
  }
  /// [m] Of the part beside the axis of the hole.
  [[nodiscard]] double beside() const { return (X_WO_.translation() - p_WTarget).head<2>().norm(); }
  [[nodiscard]] double height() const { return X_WO_.translation().z() - p_WTarget.z(); }
  /// Puts the hand with the part elsewhere, as when a clutched hand continues at another place.
  void shift(const Vector3& by) { shift_W_ = by; }

 private:
  [[nodiscard]] HandPerception hand() const {
    HandPerception hand;
    hand.X_WH = X_WH_;
    hand.object = kPart;
    hand.F_Ho_W.force = kStiffness * (X_WO_.translation() - X_WH_.translation() - shift_W_);
    hand.reach = 1.0;
    return hand;
  }
  void place(const Vector3& p_WH) {
    Vector3 p = p_WH + shift_W_;
    const bool enters = (p - p_WTarget).head<2>().norm() < kOpening;
    p.z() = std::max(p.z(), enters ? p_WTarget.z() : kPlate);
    X_WO_ = Pose(p);
  }

  AssemblyBehavior behavior_;
  DelayedPerception perception_;
  PathPlanner planner_;
  haptic::WorldView world_;
  Pose X_WH_, X_WO_;
  Vector3 shift_W_ = Vector3::Zero();
  Tick tick_ = 0;
};

TEST(AssemblyBehavior, InsertsThePartAndHoldsIt) {
  Plate plate;
  ASSERT_TRUE(plate.runUntil("holds"));
  EXPECT_LT(plate.beside(), kOpening);
  EXPECT_LT(plate.height(), 0.003);
}

TEST(AssemblyBehavior, AHandThatWasFrozenOnItsWayAimsAtTheHoleAgain) {
  Plate plate;
  plate.run(0.5);
  plate.run(20.0, true);
  ASSERT_TRUE(plate.runUntil("pushes in"));
  EXPECT_LT(plate.beside(), 0.01);
  EXPECT_TRUE(plate.runUntil("holds"));
}

TEST(AssemblyBehavior, APartThatIsFarBesideTheHoleIsBroughtBackAndAligned) {
  Plate plate;
  ASSERT_TRUE(plate.runUntil("pushes in"));
  plate.shift(Vector3(0.03, -0.03, 0.0));
  ASSERT_TRUE(plate.runUntil("aligns")) << "it pushes beside the hole";
  ASSERT_TRUE(plate.runUntil("holds"));
  EXPECT_LT(plate.beside(), kOpening);
}

}  // namespace
}  // namespace tenon::simulated_person
