#include <memory>
#include <ostream>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "devices/safety_rules.h"
#include "devices/simulated/hug.h"
#include "tests/clients/haptic/hand_above_floor.h"

// A hand holds a part that fits a hole: the part cannot turn. The person's wrist turns by 20 degrees while
// contacts are interrupted. No shift of the workspace takes that away, so the torque is limited alone:
//
//   torque                            .--     it is what the wrist asks for, slowly
//    0.1 Nm ---.        .-----------'         never above max(before, limit) for a second
//               `.____.'
//               gap   return

namespace tenon::haptic {
namespace {

constexpr double kPartReach = 0.03;            // [m] of the part's contacts
constexpr double kWristTurn = 20.0 / 57.2958;  // [rad]
constexpr int kTorqueWindow = 20;              // [ticks] over which the growth is measured

std::unique_ptr<devices::HapticDevice> openWithTorque(const std::string& name) {
  if (name != "hug-sim") return std::move(*devices::openDevice(name));
  auto arm = std::make_unique<devices::SimulatedDevice>(devices::hugArmModel(), 1);
  EXPECT_TRUE(arm->open());
  return arm;
}

/// As stiff as its device allows.
struct HandWithPartInAHole : test::HandAboveFloor {
  explicit HandWithPartInAHole(const std::string& name)
      : HandAboveFloor(openWithTorque(name), 0.012,
                       devices::safetyLimits(openWithTorque(name)->caps()).stiffness),
        rotational_stiffness(devices::safetyLimits(device->caps()).rotational_stiffness) {
    arm().setContraction(1.0);
  }
  [[nodiscard]] double torque() const { return hand.state().F_Ho_W.torque.norm(); }
  /// Four points below and four above, none of which gives way.
  [[nodiscard]] HandManifold held() const {
    HandManifold held = server.manifold(tick, hand.pose());
    held.rotational_stiffness = rotational_stiffness;
    const Vector3& p_WH = hand.pose().translation();
    held.X_WO = Pose(Vector3(p_WH.x(), p_WH.y(), server.radius));
    held.contacts.clear();
    for (const double side : {-1.0, 1.0}) {
      for (const double x : {-kPartReach, kPartReach}) {
        for (const double y : {-kPartReach, kPartReach}) {
          ManifoldContact contact;
          contact.other = test::kFloor;
          contact.p_BoP_B = Vector3(x, y, side * server.radius).cast<float>();
          contact.normal_A = Vector3(0.0, 0.0, -side).cast<float>();
          contact.offset = side > 0.0 ? static_cast<float>(-2.0 * server.radius) : 0.0F;
          held.contacts.push_back(contact);
        }
      }
    }
    return held;
  }
  /// One cycle in which the person wants the wrist turned by `angle` [rad].
  void turn(double angle, bool answered = true) {
    const Quaternion q(Eigen::AngleAxisd(angle, Vector3::UnitX()));
    arm().setIntent(hand.workspace().toDevice(Pose(Vector3(0.0, 0.0, server.radius), q)));
    if (answered) {
      world.receive(server.frame(tick));
      hand.receive(held());
    }
    cycle();
  }

  double rotational_stiffness;  // [Nm/rad]
};

struct TorqueCase {
  const char* name;
  double most;    // [Nm]
  double growth;  // [Nm/s]
};
void PrintTo(const TorqueCase& device, std::ostream* out) { *out << device.name; }

class TorqueReturn : public testing::TestWithParam<std::tuple<TorqueCase, int>> {};

TEST_P(TorqueReturn, AfterAGapInWhichTheWristTurnedIsSoft) {
  const auto& [device, gap] = GetParam();
  HandWithPartInAHole setup(device.name);
  for (int i = 0; i < 1500; ++i) setup.turn(0.0);
  // a tenth of what is let through at a start
  const double held = 0.1 * device.most / 15.0;
  for (int i = 0; i < 500; ++i) setup.turn(held);
  const double before = setup.torque();
  ASSERT_LT(before, 0.5 * device.most);
  for (int i = 0; i < gap; ++i) {
    setup.turn(i < 100 ? held : kWristTurn, false);
    ASSERT_LE(setup.torque(), before + 1e-3) << i << " ms into the gap";
  }
  ASSERT_EQ(setup.torque(), 0.0);
  std::vector<double> torques;
  for (int i = 0; i < 1000; ++i) {
    setup.turn(kWristTurn);
    torques.push_back(setup.torque());
    ASSERT_LE(torques.back(), device.most + 1e-3) << i << " ms after the return";
    if (i < kTorqueWindow) continue;
    const double growth =
        (torques.back() - torques[torques.size() - 1 - kTorqueWindow]) / (kTorqueWindow * kTickSeconds);
    ASSERT_LE(growth, 1.05 * device.growth) << i << " ms after the return";
  }
  EXPECT_GT(torques.back(), 0.5 * device.most);
  for (int i = 0; i < 3000; ++i) setup.turn(kWristTurn);
  EXPECT_GT(setup.torque(), 2.0 * device.most) << "who continues to turn feels that the part does not";
}

INSTANTIATE_TEST_SUITE_P(Devices, TorqueReturn,
                         testing::Combine(testing::Values(TorqueCase{"hug-sim", 0.3, 2.0},
                                                          TorqueCase{"sigma7-sim", 0.06, 0.4}),
                                          testing::Values(300, 800, 4000)),
                         [](const auto& one) {
                           const std::string name = std::get<0>(one.param).name;
                           return name.substr(0, name.find('-')) + std::to_string(std::get<1>(one.param)) +
                                  "ms";
                         });

}  // namespace
}  // namespace tenon::haptic
