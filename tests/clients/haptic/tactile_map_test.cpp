#include "clients/haptic/tactile_map.h"

#include <cmath>

#include <gtest/gtest.h>

namespace tenon::haptic {
namespace {

constexpr double kMapStep = 1e-3;

//          0
//      5   z   1        view along x from the elbow, y to the right
//          |__y
//      4       2
//          3
HandManifold contactAt(double degrees, double depth) {
  HandManifold manifold;
  manifold.stiffness = 1000.0;
  ManifoldContact contact;
  const double angle = degrees * M_PI / 180.0;
  contact.p_BoP_B =
      Vector3f(0.1F, static_cast<float>(0.04 * std::sin(angle)), static_cast<float>(0.04 * std::cos(angle)));
  contact.gap = static_cast<float>(-depth);
  manifold.contacts.push_back(contact);
  return manifold;
}

TEST(TactileMap, DrivesOnlyTheTactorAtTheContact) {
  for (int tactor = 0; tactor < kTactors; ++tactor) {
    TactileMap map;
    const TactorIntensities intensities = map.step(contactAt(60.0 * tactor, 0.004), kMapStep);
    for (int i = 0; i < kTactors; ++i)
      EXPECT_EQ(intensities[static_cast<std::size_t>(i)] > 0, i == tactor) << tactor;
  }
}

TEST(TactileMap, DistributesAContactBetweenTwoTactors) {
  TactileMap map;
  map.step(contactAt(30.0, 0.004), kMapStep);
  EXPECT_NEAR(map.forces()[0], map.forces()[1], 1e-4);
  EXPECT_GT(map.forces()[0], 0.0);
  EXPECT_EQ(map.forces()[2], 0.0);
}

TEST(TactileMap, IntensityGrowsWithDepthAndIsZeroWithoutContact) {
  TactileMap map;
  const auto weak = map.step(contactAt(0.0, 0.001), kMapStep)[0];
  const auto strong = map.step(contactAt(0.0, 0.006), kMapStep)[0];
  EXPECT_LT(weak, strong);
  EXPECT_EQ(map.step(contactAt(0.0, 0.020), kMapStep)[0], 255);
  EXPECT_EQ(map.step(contactAt(0.0, -0.001), kMapStep), TactorIntensities{});
  EXPECT_EQ(map.step(HandManifold{}, kMapStep), TactorIntensities{});
}

TEST(TactileMap, PulseRateGrowsWithContactForceInPatternMode) {
  const auto pulses = [](double depth) {
    TactileMap map({.mode = TactileMode::kPattern});
    int pulse_count = 0;
    bool on = false;
    for (int i = 0; i < 3000; ++i) {
      const bool now = map.step(contactAt(120.0, depth), kMapStep)[2] > 0;
      if (now && !on) ++pulse_count;
      on = now;
    }
    return pulse_count;
  };
  EXPECT_GE(pulses(0.0005), 4);
  EXPECT_GT(pulses(0.008), 2 * pulses(0.0005));
}

}  // namespace
}  // namespace tenon::haptic
