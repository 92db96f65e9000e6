#include "server/simulation/compiled_scene.h"

#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/server/simulation/busy_scene.h"
#include "tests/support/damaged_structures.h"

namespace tenon::simulation {
namespace {

using test::BusyScene;
using test::SmallScene;

std::vector<std::uint8_t> bytesOf(const Scene& scene) {
  auto bytes = sceneBytes(scene);
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().what);
  return bytes.value_or(std::vector<std::uint8_t>{});
}

/// A part with every number that a scene has, over a floor; both small, so that damages hit all of it.
std::shared_ptr<const Scene> smallScene() {
  SmallScene small;
  const ObjectId floor = small.object("floor", test::cubeShape(), {0.0, 0.0, -0.02}, ObjectStatus::kFixed);
  const ObjectId box = small.freeBox("box", Vector3::Constant(test::kCubeEdge), 0.3, {0.0, 0.0, 0.05});
  const ObjectId pointer = small.object("pointer", test::pointerShape(), {0.1, 0.0, 0.2});
  small.spec(box).body->friction = 0.4;
  // of a rotated tensor, which rounding leaves not quite symmetric
  Matrix3& inertia = small.spec(box).body->inertia_C_O;
  inertia(0, 1) = 1e-6 * (1.0 + 1e-14), inertia(1, 0) = 1e-6;
  small.hand("right", pointer);
  small.pair(box, floor);
  small.pair(pointer, box);
  small.gravity({0.0, 0.0, -9.0});
  auto scene = std::make_shared<Scene>(*small.build());
  scene->pairs[1].friction = collision::Friction{0.5, 0.3};
  scene->pairs[1].most_dilation_a = 1e-4;
  return scene;
}

TEST(CompiledScene, TicksOfTheSceneThatWasReadHaveTheSameBits) {
  const BusyScene busy;
  const auto read = readScene(bytesOf(*busy.scene));
  ASSERT_TRUE(read) << read.error().what;
  EnvironmentOptions options;
  Environment server(busy.scene, options), station(*read, options);
  ASSERT_EQ(server.hash(), station.hash());
  for (Tick tick = 1; tick <= 3000; ++tick) {
    for (Environment* const environment : {&server, &station}) {
      busy.act(*environment, tick);
      environment->step();
    }
    ASSERT_EQ(server.hash(), station.hash()) << "tick " << tick;
  }
  EXPECT_EQ(server.save(), station.save());
}

TEST(CompiledScene, BodiesFrictionAndGravityAreInIt) {
  const auto scene = smallScene();
  const auto read = readScene(bytesOf(*scene));
  ASSERT_TRUE(read) << read.error().what;
  Environment server(scene, {}), station(*read, {});
  for (Environment* const environment : {&server, &station}) {
    test::activateHand(*environment, HandId{0}, {0.0, 0.0, 0.2});
    test::moveHandTo(*environment, HandId{0}, {0.005, 0.0, 0.048}, 400);
  }
  EXPECT_GT(server.hands()[0].F_Ho_W.force.norm(), 1.0);
  EXPECT_EQ(server.hash(), station.hash());
}

TEST(CompiledScene, HasTheSameBytesWhereverAndHoweverOftenItIsMade) {
  const auto scene = smallScene();
  const auto bytes = bytesOf(*scene);
  auto elsewhere = std::make_shared<Scene>(*scene);
  for (ObjectSpec& object : elsewhere->objects) {
    auto baked = std::make_shared<structures::HapticStructures>(*object.structures);
    baked->info.bake_seconds = 17.0;
    baked->info.meshes = {"/another/machine/part.stl"};
    object.structures = baked;
    object.title = "Teil";
  }
  EXPECT_EQ(bytesOf(*elsewhere), bytes);
  const auto read = readScene(bytes);
  ASSERT_TRUE(read);
  EXPECT_EQ(bytesOf(**read), bytes);
}

TEST(CompiledScene, SharedStructuresAreInItOnce) {
  SmallScene one, four;
  one.object("a", test::cubeShape(), Vector3::Zero());
  for (const char* const name : {"a", "b", "c", "d"}) four.object(name, test::cubeShape(), Vector3::Zero());
  EXPECT_LT(bytesOf(*four.build()).size(), bytesOf(*one.build()).size() + 1000);
}

TEST(CompiledScene, RefusesWhatIsNoneOrCutOff) {
  EXPECT_FALSE(readScene({}));
  const auto bytes = bytesOf(*smallScene());
  for (std::size_t length = 0; length < bytes.size(); length += 1 + bytes.size() / 500)
    EXPECT_FALSE(readScene(std::span(bytes).first(length))) << length;
  auto longer = bytes;
  longer.push_back(0);
  EXPECT_FALSE(readScene(longer));
  auto newer = bytes;
  newer[8] = 2;
  EXPECT_NE(readScene(newer).error().what.find("version"), std::string::npos);
}

//   the store has checked the content's hash: whoever sends another hash with it gets this far
TEST(CompiledScene, DamagedBytesAreRefusedOrGiveASceneThatRuns) {
  const auto whole = bytesOf(*smallScene());
  const auto ofScene = whole.size() - 500;  // behind the structures, whose own checks have their own test
  int accepted = 0, refused = 0;
  for (std::uint64_t seed = 1; seed <= 4000; ++seed) {
    auto bytes = whole;
    test::FileDamage damage(seed);
    if (seed % 16 == 0) damage.truncate(bytes);
    damage.damage(bytes, seed % 4 == 0 ? 0 : ofScene);
    const auto read = readScene(bytes);
    ++(read ? accepted : refused);
    if (!read || seed % 8 != 0) continue;
    Environment environment(*read, {});
    test::activateHand(environment, HandId{0}, {0.0, 0.0, 0.1});
    test::moveHandTo(environment, HandId{0}, {0.0, 0.0, 0.05}, 20);
  }
  EXPECT_GT(refused, 1000);
  EXPECT_GT(accepted, 100);  // damages of a title, a colour, a pose
}

}  // namespace
}  // namespace tenon::simulation
