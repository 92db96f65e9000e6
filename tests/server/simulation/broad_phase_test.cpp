#include "server/simulation/broad_phase.h"

#include <algorithm>
#include <array>
#include <random>

#include <gtest/gtest.h>

#include "tests/server/simulation/small_scene.h"

namespace tenon::simulation {
namespace {

struct Sphere {
  Vector3 p_WC;
  double radius = 0.0;
  bool present = true;
};

double dilationOf(const Scene& scene, ObjectId object) {
  const auto& structures = scene.objects[object.value].structures;
  return structures ? structures->field.dilation() : 0.0;
}

/// Brute force over all pairs.
std::vector<std::uint32_t> bruteForce(const Scene& scene, const std::vector<Sphere>& spheres, double margin) {
  std::vector<std::uint32_t> result;
  for (std::uint32_t pair = 0; pair < scene.pairs.size(); ++pair) {
    const PairSpec& spec = scene.pairs[pair];
    const Sphere& a = spheres[spec.a.value];
    const Sphere& b = spheres[spec.b.value];
    const double dilation = std::max(dilationOf(scene, spec.a), dilationOf(scene, spec.b));
    const double gap = (a.p_WC - b.p_WC).norm() - a.radius - b.radius - dilation;
    if (a.present && b.present && gap <= margin) result.push_back(pair);
  }
  return result;
}

std::vector<std::uint32_t> findPairs(BroadPhase& sweep, const std::vector<Sphere>& spheres, double margin) {
  for (std::uint32_t i = 0; i < spheres.size(); ++i) {
    if (spheres[i].present) {
      sweep.setSphere(ObjectId{i}, spheres[i].p_WC, spheres[i].radius);
    } else {
      sweep.remove(ObjectId{i});
    }
  }
  const auto pairs = sweep.findPairs(margin);
  return {pairs.begin(), pairs.end()};
}

class BroadPhaseTest : public testing::Test {
 protected:
  static constexpr std::uint32_t kSpheres = 60;

  BroadPhaseTest() {
    const test::StructuresPtr thick = test::dilated(test::pointerShape(), 0.003);
    for (std::uint32_t i = 0; i < kSpheres; ++i)
      small_.object("sphere", i % 3 == 0 ? thick : nullptr, Vector3::Zero());
    for (std::uint32_t i = 0; i < kSpheres; ++i) {
      for (std::uint32_t j = 0; j < i; ++j) {
        if ((i + j) % 5 != 0) small_.pair(ObjectId{i}, ObjectId{j});
      }
    }
    // a second pair of the same two objects, in the other order
    small_.pair(ObjectId{0}, ObjectId{1});
    scene_ = small_.build();
    spheres_.resize(kSpheres);
    // the last one is as large as a floor
    for (std::uint32_t i = 0; i < kSpheres; ++i)
      spheres_[i].radius = i + 1 == kSpheres ? 0.7 : 0.01 + 0.001 * (i % 7);
  }

  Vector3 randomPosition() { return {coordinate_(random_), coordinate_(random_), coordinate_(random_)}; }

  test::SmallScene small_;
  std::shared_ptr<const Scene> scene_;
  std::vector<Sphere> spheres_;
  std::mt19937 random_{7};
  std::uniform_real_distribution<double> coordinate_{-0.2, 0.2};
};

TEST_F(BroadPhaseTest, FindsTheSamePairsAsBruteForce) {
  BroadPhase sweep(*scene_);
  for (Sphere& sphere : spheres_) sphere.p_WC = randomPosition();
  std::size_t near = 0;
  for (int tick = 0; tick < 300; ++tick) {
    for (Sphere& sphere : spheres_) sphere.p_WC += 0.02 * randomPosition();
    spheres_[static_cast<std::size_t>(tick) % kSpheres].p_WC = randomPosition();
    Sphere& toggled = spheres_[static_cast<std::size_t>(7 * tick) % kSpheres];
    toggled.present = !toggled.present;
    const auto expected = bruteForce(*scene_, spheres_, 0.005);
    ASSERT_EQ(findPairs(sweep, spheres_, 0.005), expected) << "tick " << tick;
    near += expected.size();
  }
  EXPECT_GT(near, 10U * 300U);
}

// All centres have the same x: the order of equal interval ends must not depend on earlier ticks.
TEST_F(BroadPhaseTest, TheResultDependsOnThePosesAlone) {
  BroadPhase used(*scene_);
  for (int tick = 0; tick < 20; ++tick) {
    for (Sphere& sphere : spheres_) sphere.p_WC = randomPosition();
    (void)findPairs(used, spheres_, 0.005);
  }
  for (Sphere& sphere : spheres_) sphere.p_WC.x() = 0.0;
  BroadPhase fresh(*scene_);
  EXPECT_EQ(findPairs(used, spheres_, 0.005), findPairs(fresh, spheres_, 0.005));
}

}  // namespace
}  // namespace tenon::simulation
