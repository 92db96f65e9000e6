#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "server/simulation/environment.h"
#include "tests/server/simulation/small_scene.h"
#include "tests/server/simulation/wave.h"

namespace tenon::simulation {
namespace {

using test::cubeShape;
using test::kCubeEdge;

//        . - - - .              the hand turns a long rod about its middle, near posts that its ends
//      .     |     .   o post   hit: the middle hardly moves, the ends move at the speed cap
//     .  ====+====  .
//      .     |     .
//        ` - - - `
struct RodAndPosts {
  RodAndPosts() {
    rod = small.object("rod", test::boxStructures({0.6, 0.02, 0.02}, 0.004, 0.005), {0.0, 0.0, 0.1});
    hand = small.hand("hand", rod);
    for (const Vector3& p : {Vector3(0.0, 0.29, 0.1), Vector3(-0.33, 0.0, 0.1), Vector3(0.2, -0.25, 0.1)}) {
      posts.push_back(small.object("post", test::cubeShape(), p));
      pairs.push_back(small.pair(rod, posts.back()));
    }
    scene = small.build();
  }
  void step(Environment& environment) const {
    const Tick tick = environment.tick() + 1;
    if (tick == 1) environment.setHandPresent(hand, true);
    const Vector3 rotation(0.0, 0.0, 1.2 * (1.0 - test::triangleWave(tick, 1300)));
    environment.setHandPose(
        hand, Pose(Vector3(0.03 * test::triangleWave(tick, 700), 0.0, 0.1), expRotation(rotation)), {});
    environment.step();
  }

  test::SmallScene small;
  std::shared_ptr<const Scene> scene;
  ObjectId rod;
  HandId hand;
  std::vector<ObjectId> posts;
  std::vector<std::size_t> pairs;
};

TEST(Coherence, NoContactOfTheEndsOfATurningRodIsMissed) {
  const RodAndPosts rig;
  EnvironmentOptions every_pair;
  every_pair.coherence = false;
  Environment skipping(rig.scene, {});
  Environment querying(rig.scene, every_pair);
  int touching = 0;
  std::uint32_t queries_skipping = 0;
  std::uint32_t queries_querying = 0;
  for (int tick = 0; tick < 4000; ++tick) {
    rig.step(skipping);
    rig.step(querying);
    ASSERT_EQ(skipping.objects()[rig.rod.value].X_WO, querying.objects()[rig.rod.value].X_WO)
        << "tick " << tick;
    for (const ObjectId post : rig.posts) {
      ASSERT_EQ(skipping.inContact(rig.rod, post), querying.inContact(rig.rod, post)) << "tick " << tick;
      touching += querying.inContact(rig.rod, post) ? 1 : 0;
    }
    queries_skipping += skipping.work().queried_pairs;
    queries_querying += querying.work().queried_pairs;
  }
  EXPECT_GT(touching, 200);
  EXPECT_LT(2 * queries_skipping, queries_querying);
}

TEST(Coherence, ThePointsOfARodKeepTheSpeedCapAssumedByCoherence) {
  const RodAndPosts rig;
  EnvironmentOptions options;
  options.max_speed = 0.1;
  options.max_turn_rate = 1.0;
  Environment environment(rig.scene, options);
  // the rod's bounding ball reaches to its corners
  const double cap =
      (options.max_speed + options.max_turn_rate * 0.5 * Vector3(0.6, 0.02, 0.02).norm()) * kTickSeconds;
  double farthest = 0.0;
  for (int tick = 0; tick < 2000; ++tick) {
    const Pose before = environment.objects()[rig.rod.value].X_WO;
    rig.step(environment);
    if (tick == 0) continue;
    const Pose& X_WO = environment.objects()[rig.rod.value].X_WO;
    for (const double x : {-0.3, 0.3}) {
      const Vector3 end(x, 0.01, 0.01);
      farthest = std::max(farthest, (X_WO * end - before * end).norm());
    }
  }
  EXPECT_LE(farthest, cap * (1.0 + 1e-9));
  EXPECT_GT(farthest, 0.9 * cap) << "the hand moves faster than the cap";
}

// gap / (v_a + v_b): half as many ticks when both objects move. A cap is that of the centre and that of the
// rotation times the radius.
TEST(Coherence, APairIsSkippedForItsGapOverTheSumOfSpeedCaps) {
  test::SmallScene small;
  const ObjectId left = small.object("left", test::cubeShape(), {0.0, 0.0, 0.0});
  const ObjectId right = small.object("right", test::cubeShape(), {test::kCubeEdge + 0.02, 0.0, 0.0});
  const HandId left_hand = small.hand("left", left);
  const HandId right_hand = small.hand("right", right);
  const std::size_t pair = small.pair(left, right);
  Environment environment(small.build(), {});
  EXPECT_TRUE(environment.pairs()[pair].due == 0);
  environment.step();
  EXPECT_EQ(environment.pairs()[pair].due, std::numeric_limits<Tick>::max()) << "neither object moves";

  // the margin of a query is 3 mm
  const auto expected = [&](double closing_speed) {
    PairContact contact;
    environment.pairContact(pair, contact);
    EXPECT_GT(contact.gap, 0.005);
    EXPECT_LT(contact.gap, 0.02);
    return (contact.gap - 0.003) / (closing_speed * kTickSeconds);
  };
  test::activateHand(environment, left_hand, {0.0, 0.0, 0.0});
  environment.step();
  const EnvironmentOptions caps;
  const double cap = caps.max_speed + caps.max_turn_rate * 0.5 * std::sqrt(3.0) * kCubeEdge;
  EXPECT_NEAR(static_cast<double>(environment.pairs()[pair].due - environment.tick()), expected(cap), 1.0);
  test::activateHand(environment, right_hand, {test::kCubeEdge + 0.02, 0.0, 0.0});
  environment.step();
  EXPECT_NEAR(static_cast<double>(environment.pairs()[pair].due - environment.tick()), expected(2.0 * cap),
              1.0);
}

TEST(Groups, CanBeChangedBetweenTicks) {
  test::SmallScene small;
  const ObjectId held = small.object("held", test::cubeShape(), {0.0, 0.0, 0.1});
  const ObjectId block = small.object("block", test::cubeShape(), {0.0, 0.0, 0.0});
  const HandId hand = small.hand("hand", held);
  small.pair(held, block);
  Environment environment(small.build(), {});
  test::activateHand(environment, hand, {0.0, 0.0, 0.1});
  test::moveHandTo(environment, hand, {0.0, 0.0, 0.03}, 200);
  const auto height = [&] { return environment.objects()[held.value].X_WO.translation().z(); };
  EXPECT_NEAR(height(), test::kCubeEdge, 1e-4);
  EXPECT_EQ(environment.work().active_pairs, 1U);

  environment.setGroup(held, 7);
  environment.setGroup(block, 7);
  const std::vector<std::uint8_t> grouped = environment.save();
  test::stepTicks(environment, 50);
  EXPECT_EQ(environment.work().active_pairs, 0U);
  EXPECT_NEAR(height(), 0.03, 1e-6) << "no collision within a group";
  EXPECT_FALSE(environment.inContact(held, block));
  EXPECT_EQ(environment.forceOn(block).force.norm(), 0.0);

  test::moveHandTo(environment, hand, {0.0, 0.0, 0.1}, 200);
  environment.setGroup(block, 8);
  test::moveHandTo(environment, hand, {0.0, 0.0, 0.03}, 200);
  EXPECT_NEAR(height(), test::kCubeEdge, 1e-4) << "in different groups again";
  EXPECT_TRUE(environment.inContact(held, block));

  ASSERT_TRUE(environment.restore(grouped));
  EXPECT_EQ(environment.groupOf(block), 7U);
}

TEST(Groups, ObjectsWithoutAGroupCollide) {
  test::SmallScene small;
  const ObjectId one = small.object("one", test::cubeShape(), {0.0, 0.0, 0.0}, ObjectStatus::kParked, 4);
  const ObjectId other = small.object("other", test::cubeShape(), {0.03, 0.0, 0.0}, ObjectStatus::kParked, 4);
  small.pair(one, other);
  Environment environment(small.build(), {});
  environment.step();
  EXPECT_FALSE(environment.inContact(one, other));
  environment.setGroup(one, 0);
  environment.setGroup(other, 0);
  environment.step();
  EXPECT_TRUE(environment.inContact(one, other));
}

}  // namespace
}  // namespace tenon::simulation
