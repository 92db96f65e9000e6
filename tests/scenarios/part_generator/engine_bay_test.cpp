#include <map>
#include <string>

#include <gtest/gtest.h>

#include "scenarios/part_generator/engine_bay_layout.h"
#include "scenarios/part_generator/scenario_parts.h"
#include "tests/scenarios/part_generator/solid_probe.h"

namespace tenon::part_generator {
namespace {

using engine_bay::PartLayout;

const PartMesh& mesh(std::string_view name) {
  static std::map<std::string, PartMesh, std::less<>> meshes;
  auto found = meshes.find(name);
  if (found == meshes.end()) {
    for (const ScenarioPart& part : engineBayParts().parts) {
      if (part.name == name) found = meshes.emplace(std::string(name), part.make(0.0)).first;
    }
  }
  return found->second;
}

Eigen::AlignedBox3d enlarged(Eigen::AlignedBox3d box, double margin) {
  box.min().array() -= margin;
  box.max().array() += margin;
  return box;
}

/// The part's box in W, swept along the approach to its target.
Eigen::AlignedBox3d sweptBox(const engine_bay::PartLayout& part) {
  Eigen::AlignedBox3d box = part.box_P;
  box.extend(part.box_P.min() - engine_bay::kApproachDistance * engine_bay::approachDirection(part.approach));
  box.extend(part.box_P.max() - engine_bay::kApproachDistance * engine_bay::approachDirection(part.approach));
  return box.translated(part.p_WT);
}

class EngineBayPart : public testing::TestWithParam<int> {
 protected:
  const engine_bay::PartLayout& part() const {
    return engine_bay::parts()[static_cast<std::size_t>(GetParam())];
  }
  Pose target() const { return engine_bay::targetPose(part()); }
};

INSTANTIATE_TEST_SUITE_P(All, EngineBayPart, testing::Range(0, 5), [](const auto& tested) {
  return std::string(engine_bay::parts()[static_cast<std::size_t>(tested.param)].name);
});

TEST(EngineBay, HasTheSizeGivenInThePaper) {
  const Eigen::AlignedBox3d box = mesh("engine_bay").box();
  EXPECT_TRUE(box.sizes().isApprox(engine_bay::kBaySize, 1e-12)) << box.sizes().transpose();
  EXPECT_TRUE(box.min().isApprox(Vector3(-1.535, 0.0, 0.0), 1e-12)) << box.min().transpose();
}

TEST_P(EngineBayPart, StaysWithinTheBoxOfTheLayout) {
  EXPECT_TRUE(enlarged(part().box_P, 1e-9).contains(mesh(part().name).box()))
      << mesh(part().name).box().min().transpose() << "  " << mesh(part().name).box().max().transpose();
}

TEST_P(EngineBayPart, StartsInFrontOfTheBay) {
  const Eigen::AlignedBox3d box = part().box_P.translated(engine_bay::startPose(part()).translation());
  EXPECT_LT(box.max().y(), -0.05);
}

//        | P |         At the target the tongue has gaps of 1.3 mm on each side and half a millimetre below:
//    \   |   |   /     no point of the part is nearer to the bay than that, and none is inside it.
//     |  |___|  |
//     |_________|
TEST_P(EngineBayPart, TouchesNothingAtItsTarget) {
  const Eigen::AlignedBox3d region = enlarged(part().box_P.translated(part().p_WT), 0.02);
  const test::SolidProbe bay(mesh("engine_bay"), Pose(), region);
  const auto points = test::surfacePoints(mesh(part().name), target(), 0.006, region);
  double nearest = 1.0;
  for (const Vector3& p_W : test::onePointPerCell(points, 0.012))
    ASSERT_FALSE(bay.inside(p_W)) << p_W.transpose();
  for (const Vector3& p_W : test::onePointPerCell(points, 0.003)) {
    const double distance = bay.distance(p_W, 0.01);
    ASSERT_GT(distance, engine_bay::kSeatGap - 1e-6) << p_W.transpose();
    nearest = std::min(nearest, distance);
  }
  EXPECT_NEAR(nearest, engine_bay::kSeatGap, 1e-6) << "the tip is kSeatGap above the floor of its pocket";
}

TEST_P(EngineBayPart, ContainsNothingOfTheBayAtItsTarget) {
  const Eigen::AlignedBox3d region = enlarged(part().box_P.translated(part().p_WT), 0.002);
  const test::SolidProbe solid(mesh(part().name), target(), region);
  const std::vector<Vector3> points = test::surfacePoints(mesh("engine_bay"), Pose(), 0.005, region);
  ASSERT_FALSE(points.empty());
  for (const Vector3& p_W : points) {
    ASSERT_FALSE(solid.inside(p_W)) << p_W.transpose();
  }
}

TEST_P(EngineBayPart, OnlyItsTonguesComeNearTheBay) {
  const Eigen::AlignedBox3d region = enlarged(part().box_P.translated(part().p_WT), 0.02);
  const test::SolidProbe bay(mesh("engine_bay"), Pose(), region);
  const Pose X_GW = (target() * engine_bay::guideFrame(part().approach)).inverse();
  const double mouth = part().tongues[0].tip + engine_bay::kInsertion;
  std::size_t measured = 0;
  for (const Vector3& p_W : test::surfacePoints(mesh(part().name), target(), 0.008, region)) {
    if ((X_GW * p_W).z() < mouth + 0.005) continue;
    ASSERT_GT(bay.distance(p_W, 0.02), 0.004) << p_W.transpose();
    ++measured;
  }
  EXPECT_GT(measured, 100U);
}

TEST_P(EngineBayPart, HasACollisionFreeApproachToItsTarget) {
  const Eigen::AlignedBox3d region = enlarged(sweptBox(part()), 0.06);
  const test::SolidProbe bay(mesh("engine_bay"), Pose(), region);
  const auto points =
      test::onePointPerCell(test::surfacePoints(mesh(part().name), target(), 0.03, region), 0.03);
  ASSERT_GT(points.size(), 10U);
  const Vector3 back = -engine_bay::approachDirection(part().approach);
  const Pose X_WG = target() * engine_bay::guideFrame(part().approach);
  const Vector3 x_W = X_WG.rotation() * Vector3::UnitX();
  const Vector3 y_W = X_WG.rotation() * Vector3::UnitY();
  for (double s = 0.0; s <= engine_bay::kApproachDistance; s += 0.03) {
    // before the mouth of the pocket the approach is also free 50 mm to each side
    const double offset = s < engine_bay::kInsertion + 0.025 ? 0.0 : 0.05;
    for (const Vector3& shift : {Vector3(Vector3::Zero()), Vector3(offset * x_W), Vector3(-offset * x_W),
                                 Vector3(offset * y_W), Vector3(-offset * y_W)}) {
      for (const Vector3& p_W : points) {
        ASSERT_FALSE(bay.inside(p_W + s * back + shift))
            << "at " << s << " m: " << (p_W + s * back + shift).transpose();
      }
    }
  }
}

TEST_P(EngineBayPart, IsCapturedByItsFunnelsWithErrorsOfSixMillimetresAndFiveDegrees) {
  const double yaw = 5.0 * 3.141592653589793 / 180.0;
  ASSERT_FALSE(part().usedTongues().empty());
  for (const engine_bay::Tongue& t : part().usedTongues()) {
    const double x = std::abs(t.x) + 0.5 * t.width;
    const double y = std::abs(t.y) + 0.5 * t.depth;
    const double capture_range = engine_bay::kGap + engine_bay::kFunnel + t.chamfer;
    EXPECT_LT(x * yaw + 0.006 / std::sqrt(2.0), capture_range) << "along y_G";
    EXPECT_LT(y * yaw + 0.006 / std::sqrt(2.0), capture_range) << "along x_G";
  }
}

TEST_P(EngineBayPart, CannotBeSeatedOutsideTheTolerance) {
  double span = 0.0;
  for (const engine_bay::Tongue& t : part().usedTongues())
    span = std::max(span, 2.0 * std::abs(t.x) + t.width);
  const double yaw = 2.0 * engine_bay::kGap / span;
  EXPECT_LT(yaw, 1.0 * 3.141592653589793 / 180.0);
  EXPECT_LT(std::hypot(engine_bay::kGap, engine_bay::kSeatGap), 0.0015);
}

TEST_P(EngineBayPart, LeavesItsScrewAccessibleToTheDrillOnceMounted) {
  const Pose X_WD = engine_bay::toolPose(part());
  Eigen::AlignedBox3d region;
  for (const Vector3& p_W :
       test::surfacePoints(mesh("drill"), X_WD, 1.0, enlarged({Vector3::Zero(), Vector3::Zero()}, 9.0)))
    region.extend(p_W);
  region = enlarged(region, 0.03);
  const auto points = test::surfacePoints(mesh("drill"), X_WD, 0.006, region);
  std::vector<test::SolidProbe> around{{mesh("engine_bay"), Pose(), region}};
  for (int i = 0; i <= GetParam(); ++i) {
    const engine_bay::PartLayout& mounted = engine_bay::parts()[static_cast<std::size_t>(i)];
    around.emplace_back(mesh(mounted.name), engine_bay::targetPose(mounted), region);
  }
  double nearest = 1.0;
  for (const test::SolidProbe& solid : around) {
    for (const Vector3& p_W : points) {
      ASSERT_FALSE(solid.inside(p_W)) << p_W.transpose();
      nearest = std::min(nearest, solid.distance(p_W, 0.03));
    }
  }
  EXPECT_GT(nearest, 0.005);
  EXPECT_LT(nearest, engine_bay::kToolGap + 0.001) << "the tip is at the screw";
}

TEST(EngineBay, MountedPartsDoNotOverlap) {
  for (std::size_t i = 0; i < 5; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const engine_bay::PartLayout& a = engine_bay::parts()[i];
      const engine_bay::PartLayout& b = engine_bay::parts()[j];
      EXPECT_FALSE(enlarged(a.box_P.translated(a.p_WT), 0.01).intersects(b.box_P.translated(b.p_WT)))
          << a.name << ' ' << b.name;
    }
  }
}

}  // namespace
}  // namespace tenon::part_generator
