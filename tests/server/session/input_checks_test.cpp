#include "idl/types/resolution.h"
#include "tests/server/session/registry_session.h"

namespace tenon::session {
namespace {

using ::testing::HasSubstr;

class InputChecks : public RegistrySession {};

TEST_F(InputChecks, AcceptsDeviceInputOfAControlledHand) {
  const ClientId client = join("a", Role::kTrainee, {"right"}).client;
  const auto reading = registry_.validateDeviceInput(input(client, test::kRightHand));
  ASSERT_TRUE(reading) << reading.error().what;
  EXPECT_EQ(reading->hand, test::kRightHand);
  EXPECT_EQ(reading->seq, 9U);
  EXPECT_TRUE(reading->active);
  EXPECT_EQ(reading->buttons, 1U);
  EXPECT_LE((reading->X_WH.translation() - Vector3(0.1, 0.2, 0.3)).norm(), kPositionStep);
  EXPECT_EQ(reading->X_WH, rounded(reading->X_WH)) << "as over the wire";
}

TEST_F(InputChecks, RefusesDeviceInputForHandsOfOthers) {
  const ClientId client = join("a", Role::kTrainee, {"right"}).client;
  const ClientId instructor = join("b", Role::kInstructor, {"instructor"}).client;
  DeviceInput stale = input(client, test::kRightHand);
  stale.server_epoch = kEpoch - 1;
  EXPECT_THAT(registry_.validateDeviceInput(stale).error().what, HasSubstr("earlier run"));
  EXPECT_THAT(registry_.validateDeviceInput(input(client, test::kInstructorHand)).error().what,
              HasSubstr("not its own"));
  EXPECT_THAT(registry_.validateDeviceInput(input(instructor, test::kRightHand)).error().what,
              HasSubstr("not its own"));
  EXPECT_THAT(registry_.validateDeviceInput(input(client, test::kLeftHand)).error().what,
              HasSubstr("not its own"));
  EXPECT_THAT(registry_.validateDeviceInput(input(client, HandId{17})).error().what,
              HasSubstr("does not have"));
  EXPECT_FALSE(registry_.validateDeviceInput(input(client, HandId{})));
  EXPECT_FALSE(registry_.validateDeviceInput(input(ClientId{}, test::kLeftHand)))
      << "an invalid id does not control a free hand";
}

TEST_F(InputChecks, RefusesImplausiblePosesAndVelocities) {
  const ClientId client = join("a", Role::kTrainee, {"right"}).client;
  const auto refuses = [&](auto&& corrupt) {
    DeviceInput bad = input(client, test::kRightHand);
    corrupt(bad.sample);
    return !registry_.validateDeviceInput(bad);
  };
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.X_WH = Pose(Vector3(kNan, 0, 0)); }));
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.X_WH = Pose(Vector3(1e9, 0, 0)); }));
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.X_WH = Pose(Vector3(0, -127.5, 0)); }));
  EXPECT_FALSE(refuses([](DeviceSample& s) { s.X_WH = Pose(Vector3(0, -126.5, 0)); }));
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.X_WH = Pose(Vector3::Zero(), Quaternion(0, 0, 0, 0)); }));
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.X_WH = Pose(Vector3::Zero(), Quaternion(1, 1, 0, 0)); }));
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.V_WH.linear = Vector3(0, kNan, 0); }));
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.V_WH.linear = Vector3(0, 1e300, 0); }));
  EXPECT_TRUE(refuses([](DeviceSample& s) { s.V_WH.angular = Vector3(0, 0, 1e4); }));
  EXPECT_FALSE(refuses([](DeviceSample& s) { s.V_WH.angular = Vector3(0, 0, 10); }));
}

TEST_F(InputChecks, RefusesAPeriodThatNoHandHas) {
  const ClientId client = join("a", Role::kTrainee, {"right"}).client;
  DeviceInput sparse = input(client, test::kRightHand);
  for (const std::uint8_t period : {std::uint8_t{1}, kMostInputPeriod}) {
    sparse.period = period;
    EXPECT_TRUE(registry_.validateDeviceInput(sparse)) << +period;
  }
  for (const std::uint8_t period : {std::uint8_t{0}, std::uint8_t{kMostInputPeriod + 1}, std::uint8_t{255}}) {
    sparse.period = period;
    EXPECT_THAT(registry_.validateDeviceInput(sparse).error().what, HasSubstr("expected 1 to 20")) << +period;
  }
}

TEST_F(InputChecks, OfExternalForcesThoseOfStrangersOnNothingAndNotFiniteAreRefused) {
  const ClientId trainee = join("a", Role::kTrainee).client;
  const ClientId observer = join("b", Role::kObserver).client;
  const ForceContribution push{.source = 4,
                               .client = trainee,
                               .object = ObjectId{1},
                               .F_Oo_W = {Vector3(0, 0, 5), Vector3::Zero()},
                               .lifetime_ticks = 1'000'000};
  const auto change = registry_.validateForceContribution(push);
  ASSERT_TRUE(change) << change.error().what;
  EXPECT_EQ(change->kind, ChangeKind::kContributeForce);
  EXPECT_EQ(change->object, ObjectId{1});
  EXPECT_EQ(change->index, 4U);
  EXPECT_EQ(change->lifetime_ticks, 1'000'000U) << "limits are those of the ForceBuffer";
  EXPECT_EQ(change->F_Oo_W.force, Vector3(0, 0, 5));

  const auto refuses = [&](auto&& corrupt) {
    ForceContribution bad = push;
    corrupt(bad);
    return !registry_.validateForceContribution(bad);
  };
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.client = observer; }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.client = ClientId{9}; }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.object = ObjectId{99}; }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.object = {}; }));
  EXPECT_FALSE(refuses([&](ForceContribution& f) { f.F_Oo_W.force = Vector3(0, 0, 201); }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.F_Oo_W.force = Vector3(0, kNan, 0); }));
  EXPECT_TRUE(refuses([&](ForceContribution& f) { f.F_Oo_W.torque = Vector3(0, kNan, 0); }));
}

TEST_F(InputChecks, OnlyWithInstructorRightsObjectsArePlaced) {
  const ClientId trainee = join("a", Role::kTrainee).client;
  const ClientId instructor = join("b", Role::kInstructor).client;
  const ExternalPose pose{.object = ObjectId{1}, .client = instructor, .X_WO = Pose(Vector3(1, 0, 0))};
  ASSERT_TRUE(registry_.validateExternalPose(pose));
  EXPECT_EQ(registry_.validateExternalPose(pose)->kind, ChangeKind::kPlaceObject);
  ExternalPose bad = pose;
  bad.client = trainee;
  EXPECT_FALSE(registry_.validateExternalPose(bad));
  bad = pose;
  bad.object = ObjectId{99};
  EXPECT_FALSE(registry_.validateExternalPose(bad));
  bad = pose;
  bad.X_WO = Pose(Vector3(0, 0, kNan));
  EXPECT_FALSE(registry_.validateExternalPose(bad));
}

}  // namespace
}  // namespace tenon::session
