#include "server/simulation/broad_phase.h"

#include <algorithm>
#include <array>
#include <random>

#include <gtest/gtest.h>

#include "tests/server/simulation/small_scene.h"

namespace tenon {
namespace {

struct Ball {
  Vector3 p_WC;
  double radius = 0.0;
  bool there = true;
};

/// What a loop over all pairs says.
std::vector<std::uint32_t> allNear(const Scene& scene, const std::vector<Ball>& balls, double reach) {
  std::vector<std::uint32_t> result;
  for (std::uint32_t pair = 0; pair < scene.pairs.size(); ++pair) {
    const PairSpec& spec = scene.pairs[pair];
    const Ball& a = balls[spec.a.value];
    const Ball& b = balls[spec.b.value];
    const double gap = (a.p_WC - b.p_WC).norm() - a.radius - b.radius - spec.dilation;
    if (a.there && b.there && gap <= reach) result.push_back(pair);
  }
  return result;
}

std::vector<std::uint32_t> found(BroadPhase& sweep, const std::vector<Ball>& balls, double reach) {
  for (std::uint32_t i = 0; i < balls.size(); ++i) {
    if (balls[i].there) {
      sweep.place(ObjectId{i}, balls[i].p_WC, balls[i].radius);
    } else {
      sweep.hide(ObjectId{i});
    }
  }
  const auto pairs = sweep.find(reach);
  return {pairs.begin(), pairs.end()};
}

class BroadPhaseTest : public testing::Test {
 protected:
  static constexpr std::uint32_t kBalls = 60;

  BroadPhaseTest() {
    for (std::uint32_t i = 0; i < kBalls; ++i) small_.object("ball", nullptr, Vector3::Zero());
    for (std::uint32_t i = 0; i < kBalls; ++i) {
      for (std::uint32_t j = 0; j < i; ++j) {
        if ((i + j) % 5 != 0) small_.pair(ObjectId{i}, ObjectId{j}, false, 0.001 * (i % 4));
      }
    }
    // both directions of one pair
    small_.pair(ObjectId{0}, ObjectId{1});
    scene_ = small_.build();
    balls_.resize(kBalls);
    // the last is as large as a floor
    for (std::uint32_t i = 0; i < kBalls; ++i)
      balls_[i].radius = i + 1 == kBalls ? 0.7 : 0.01 + 0.001 * (i % 7);
  }

  Vector3 anywhere() { return {place_(random_), place_(random_), place_(random_)}; }

  test::SmallScene small_;
  std::shared_ptr<const Scene> scene_;
  std::vector<Ball> balls_;
  std::mt19937 random_{7};
  std::uniform_real_distribution<double> place_{-0.2, 0.2};
};

TEST_F(BroadPhaseTest, FindsWhatALoopOverAllPairsFinds) {
  BroadPhase sweep(*scene_);
  for (Ball& ball : balls_) ball.p_WC = anywhere();
  std::size_t near = 0;
  for (int tick = 0; tick < 300; ++tick) {
    for (Ball& ball : balls_) ball.p_WC += 0.02 * anywhere();
    balls_[static_cast<std::size_t>(tick) % kBalls].p_WC = anywhere();
    Ball& blinking = balls_[static_cast<std::size_t>(7 * tick) % kBalls];
    blinking.there = !blinking.there;
    const auto expected = allNear(*scene_, balls_, 0.005);
    ASSERT_EQ(found(sweep, balls_, 0.005), expected) << "tick " << tick;
    near += expected.size();
  }
  EXPECT_GT(near, 10U * 300U);
}

// Many stand at the same x: who is sorted before whom must not depend on the way here.
TEST_F(BroadPhaseTest, AnswersFromThePosesAlone) {
  BroadPhase used(*scene_);
  for (int tick = 0; tick < 20; ++tick) {
    for (Ball& ball : balls_) ball.p_WC = anywhere();
    (void)found(used, balls_, 0.005);
  }
  for (Ball& ball : balls_) ball.p_WC.x() = 0.0;
  BroadPhase fresh(*scene_);
  EXPECT_EQ(found(used, balls_, 0.005), found(fresh, balls_, 0.005));
}

}  // namespace
}  // namespace tenon
