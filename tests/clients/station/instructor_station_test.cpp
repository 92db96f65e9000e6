#include <gtest/gtest.h>

#include "clients/haptic/local_model.h"
#include "clients/station/device_station.h"
#include "tests/support/realtime_guard.h"

namespace tenon::station {
namespace {

constexpr HandId kHand{0};
constexpr ObjectId kPointer{0}, kPart{1};

//   |part|<- [pointer]   the target is 20 mm to the left of the part and 50 mm below it; the pointer touches
//   the
//                        part's right side
/// A part that is held by a lateral spring and enters when it is above its target.
class StuckPart {
 public:
  explicit StuckPart(const char* device) {
    StationOptions options = defaultStation(Role::kInstructor);
    options.devices.front().name = device;
    station = std::move(*DeviceStation::open(options));
    SceneObject pointer, part;
    pointer.object = kPointer;
    pointer.kind = "assistant";
    pointer.size = Vector3::Constant(0.05);
    pointer.X_WO = Pose(Vector3(-0.1, -0.3, 1.25));
    part.object = kPart;
    part.kind = "part";
    part.size = Vector3(0.2, 0.1, 0.1);
    part.X_WO = part_ = Pose(Vector3(0.02, 0.5, 0.81));
    objects_ = {pointer, part};
    pointer_ = pointer.X_WO;
    world_.begin(objects_, 1, 0);
    Welcome welcome;
    welcome.accepted = true;
    welcome.client = ClientId{2};
    welcome.hands = {kHand};
    welcome.objects = {kPointer};
    welcome.server_epoch = 1;
    station->welcome(welcome, objects_);
    StepState step;
    step.revision = 1;
    step.phase = StepPhase::kActive;
    step.object = kPart;
    step.has_target = true;
    step.X_WG = Pose(Vector3(0.0, 0.5, 0.76));
    step.approach_W = -Vector3::UnitZ();
    step.tolerance = 0.002;
    station->receive(step);
  }

  void run(double seconds) {
    for (int i = 0; i < static_cast<int>(seconds * 1000.0); ++i) step();
  }

  std::unique_ptr<DeviceStation> station;
  double highest_force = 0.0;  // [N]
  bool helped = false;
  [[nodiscard]] const Pose& pointer() const { return pointer_; }

 private:
  void step() {
    ++tick_;
    EXPECT_TRUE(station->armDevices());
    station->step(static_cast<std::uint32_t>(tick_));
    const Pose& X_WH = station->inputs()[0].sample.X_WH;
    HandManifold manifold;
    manifold.hand = kHand;
    manifold.server_epoch = 1;
    manifold.tick = tick_;
    manifold.answers_seq = static_cast<std::uint32_t>(tick_);
    manifold.object = kPointer;
    manifold.object_epoch = 1;
    manifold.X_WO = tick_ == 1 ? X_WH : pointer_;
    manifold.stiffness = 1000.0;
    manifold.rotational_stiffness = 20.0;
    manifold.validity_radius = 1.0;
    const Vector3 p = manifold.X_WO.translation() - part_.translation();
    if (std::abs(p.y()) < 0.07 && std::abs(p.z()) < 0.07 && p.x() > 0.0) {
      ManifoldContact contact;
      contact.other = kPart;
      contact.p_BoP_B = Vector3f(-0.025F, 0.0F, 0.0F);
      contact.normal_A = Vector3f::UnitX();
      contact.offset = 0.1F;
      contact.gap = static_cast<float>(p.x() - 0.125);
      manifold.contacts.push_back(contact);
    }
    model_.receive(manifold);
    pointer_ = model_.step(X_WH, world_).X_WO;
    // the trainee's arm: 150 N/m about a wrong pose
    const double push = std::max(0.0, 1000.0 * (pointer_.translation().x() - X_WH.translation().x()));
    if (!helped) part_.translation().x() += 0.2 * (0.02 - push / 150.0 - part_.translation().x()) * 0.05;
    if (part_.translation().x() < 0.004) helped = true;
    if (helped) part_.translation() = Vector3(0.0, 0.5, 0.76);
    highest_force = std::max(highest_force, station->states()[0].F_Ho_W.force.norm());

    WorldFrame frame;
    frame.server_epoch = 1;
    frame.tick = tick_;
    for (const ObjectId object : {kPointer, kPart}) {
      ObjectState state;
      state.object = object;
      state.epoch = 1;
      state.X_WO = object == kPointer ? pointer_ : part_;
      state.status = static_cast<std::uint8_t>(ObjectStatus::kHeld);
      frame.states.push_back(state);
    }
    world_.receive(frame);
    station->receive(frame);
    station->receive(manifold);
  }

  std::vector<SceneObject> objects_;
  haptic::WorldView world_;
  haptic::LocalModel model_;
  Pose pointer_, part_;
  Tick tick_ = 0;
};

class InstructorWithEach : public testing::TestWithParam<std::string> {};

TEST_P(InstructorWithEach, PushesAStuckPartTowardsItsTargetAndReturns) {
  StuckPart scene(GetParam().c_str());
  scene.run(3.5);
  EXPECT_STREQ(scene.station->activity(), "watches");
  scene.run(26.5);
  EXPECT_TRUE(scene.helped) << scene.station->activity();
  EXPECT_LT(scene.highest_force, 15.0);
  scene.run(10.0);
  EXPECT_STREQ(scene.station->activity(), "watches");
  EXPECT_LT((scene.pointer().translation() - Vector3(-0.1, -0.3, 1.25)).norm(), 0.05);
}

INSTANTIATE_TEST_SUITE_P(Devices, InstructorWithEach, testing::Values("sigma7-sim", "falcon-sim"),
                         [](const auto& each) {
                           const std::string& name = each.param;
                           return name.substr(0, name.find('-'));
                         });

TEST(InstructorStation, StepAllocatesNothingAndLocksNothing) {
  StuckPart scene("sigma7-sim");
  scene.run(0.5);
  const test::RealtimeGuard guard;
  for (std::uint32_t i = 0; i < 500; ++i) scene.station->step(501 + i);
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
}

TEST(InstructorStation, AnUnknownDeviceIsRefusedWithAListOfAllDevices) {
  StationOptions options = defaultStation(Role::kInstructor);
  options.devices.front().name = "joystick";
  const auto opened = DeviceStation::open(options);
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().what.find("sigma7-sim"), std::string::npos);
}

}  // namespace
}  // namespace tenon::station
