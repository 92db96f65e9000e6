#include <algorithm>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/game_control/scenario.h"
#include "tests/server/game_control/scenario_fixture.h"
#include "tests/support/distant_origin.h"

namespace tenon::game_control {
namespace {

using test::smallScenario;
using test::smallStructures;
using test::with;
using ::testing::EndsWith;
using ::testing::HasSubstr;

ScenarioFile parsedScenario(const std::string& text) {
  return parseScenario(text, "small/scenario.yaml").value();
}

TEST(SceneBuilder, TheSmallerObjectIsThePointshellSide) {
  const ScenarioFile scenario = parsedScenario(test::smallScenario());
  const auto scene = makeScene(scenario, test::smallStructures());
  ASSERT_TRUE(scene) << scene.error().what;
  ASSERT_EQ((*scene)->pairs.size(), scenario.pairs.size());
  const auto pair = [&](const std::string& a, const std::string& b) -> const simulation::PairSpec& {
    return (*scene)->pairs[static_cast<std::size_t>(
        (*scene)->pairOf((*scene)->objectNamed(a), (*scene)->objectNamed(b)))];
  };
  EXPECT_EQ(pair("part", "bay").a, scenario.objectNamed("part"));
  EXPECT_EQ(pair("part", "pointer").a, scenario.objectNamed("pointer"));
  EXPECT_EQ(pair("part", "cube").a, scenario.objectNamed("cube"))
      << "an assistant is always the pointshell side";
}

TEST(SceneBuilder, APairHasItsOwnFriction) {
  const std::string text =
      test::with(test::smallScenario(),
                 "pairs:", "pairs:\n  - {between: [pointer, bay], friction: 0.4, sliding_friction: 0.3}");
  const auto scene = makeScene(parsedScenario(text), test::smallStructures());
  ASSERT_TRUE(scene) << scene.error().what;
  const auto pair = [&](const char* a, const char* b) {
    const int number = (*scene)->pairOf((*scene)->objectNamed(a), (*scene)->objectNamed(b));
    return (*scene)->pairs[static_cast<std::size_t>(number)].friction;
  };
  ASSERT_TRUE(pair("pointer", "bay"));
  EXPECT_DOUBLE_EQ(pair("pointer", "bay")->at_rest, 0.4);
  EXPECT_DOUBLE_EQ(pair("pointer", "bay")->sliding, 0.3);
  EXPECT_FALSE(pair("part", "bay")) << "that of the bodies by default";
}

//   the bay is a solid: nothing of it is thickened, but its edges are uncertain by a fifth of a voxel
TEST(SceneBuilder, ASolidResolvesAClearanceOfFourFifthsOfAVoxel) {
  const auto withClearance = [](const char* clearance) {
    return makeScene(parsedScenario(test::with(
                         test::smallScenario(), "pairs:",
                         std::string("pairs:\n  - {between: [pointer, bay], clearance: ") + clearance + "}")),
                     test::smallStructures());
  };
  const auto refused = withClearance("0.7 mm");
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().what, HasSubstr("small/scenario.yaml:11: clearance of bay-pointer (0.7 mm)"));
  EXPECT_THAT(refused.error().what,
              HasSubstr("needs 0.8 mm there); use voxel 0.87 mm or a box in 'refine' around the "
                        "place, with refinement 2"));
  const auto accepted = withClearance("0.8 mm");
  EXPECT_TRUE(accepted) << accepted.error().what;
}

TEST(SceneBuilder, AThinWallResolvesAClearanceOfFourTimesItsDilation) {
  const auto withClearance = [](const char* clearance) {
    auto structures = test::smallStructures();
    structures[0] = test::dilated(structures[0], 0.0006);
    return makeScene(parsedScenario(test::with(test::smallScenario(), "clearance: 4 mm", clearance)),
                     structures);
  };
  const auto refused = withClearance("clearance: 2.3 mm");
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().what,
              HasSubstr("clearance of bay-part (2.3 mm) is smaller than the field of 'bay' can "
                        "resolve (voxel 1 mm / 4 needs 2.4 mm there)"));
  const auto accepted = withClearance("clearance: 2.41 mm");
  EXPECT_TRUE(accepted) << accepted.error().what;
}

TEST(SceneBuilder, AHintNamesARefinementOnlyWhereAFinerOneIsLeft) {
  const auto hint = [](const std::string& refinement) {
    auto structures = test::smallStructures();
    structures[0] = test::dilated(structures[0], 0.0006);
    std::string text = test::with(test::smallScenario(), "clearance: 4 mm", "clearance: 2.3 mm");
    text = test::with(text, "voxel: 1 mm, refinement: 4", "voxel: 1 mm, refinement: " + refinement);
    const auto scene = makeScene(parsedScenario(text), structures);
    return scene ? std::string() : scene.error().what;
  };
  EXPECT_THAT(hint("4"), EndsWith("; use voxel 0.95 mm or refinement 8"));
  EXPECT_THAT(hint("8"), EndsWith("; use voxel 0.95 mm"));
}

//   |_lid_|   mounted second, on the part
//   | part |  mounted first
//   |__bay_|
TEST(SceneBuilder, InAChainWhatIsMountedFirstIsRefinedWhereTheOtherOneComes) {
  std::string text = test::with(test::smallScenario(), "hands:\n",
                                "  - {name: lid, meshes: [{part: lid}], structures: {voxel: 2 mm}, start: "
                                "{at: [0.4, 0, 0.1]}}\nhands:\n");
  text = test::with(text, "pairs:\n", "pairs:\n  - {between: [lid, part], clearance: 4 mm}\n");
  text += R"(  - name: cover
    hands: {right: lid}
    object: lid
    target: {at: [0, 0, 20 mm]}
    approach: {direction: [0, 0, -1], distance: 50 mm}
)";
  const ScenarioFile scenario = parsedScenario(text);
  const ObjectId lid = scenario.objectNamed("lid");
  const ObjectId part = scenario.objectNamed("part");
  const auto pair = static_cast<std::size_t>(scenario.pairOf(lid, part));
  EXPECT_EQ(sdfSideByTarget(scenario, scenario.pairs[pair]), part);
  auto structures = test::smallStructures();
  structures.push_back(structures[1]);
  const auto boxes_O = refineBoxes(scenario, part, structures);
  ASSERT_EQ(boxes_O.size(), 1U);
  EXPECT_TRUE(boxes_O[0].contains(Vector3(0, 0, 0.04))) << "where the lid is, seen from the mounted part";
  EXPECT_FALSE(boxes_O[0].contains(Vector3(-0.2, 0, -0.08))) << "the same, seen from where the part was";
  const auto scene = makeScene(scenario, structures);
  ASSERT_TRUE(scene) << scene.error().what;
  EXPECT_EQ((*scene)->pairs[pair].b, part);
  const std::vector<ObjectId> order = bakeOrder(scenario);
  const auto position = [&](const char* name) {
    return std::find(order.begin(), order.end(), scenario.objectNamed(name)) - order.begin();
  };
  EXPECT_LT(position("lid"), position("part"));
  EXPECT_LT(position("part"), position("bay"));
}

TEST(SceneBuilder, RequiresStructuresOfCollidableObjects) {
  auto structures = test::smallStructures();
  structures[1] = nullptr;
  const auto scene = makeScene(parsedScenario(test::smallScenario()), structures);
  ASSERT_FALSE(scene);
  EXPECT_THAT(scene.error().what, HasSubstr("small/scenario.yaml:4: object 'part' has no haptic structures"));
  const ScenarioFile displayed_only = parsedScenario(
      test::with(test::smallScenario(), "kind: assistant", "kind: assistant, collidable: false"));
  structures = test::smallStructures();
  structures[3] = nullptr;
  EXPECT_TRUE(makeScene(displayed_only, structures));
}

TEST(SceneBuilder, RefusesATargetFarFromAllObjects) {
  const auto scene =
      makeScene(parsedScenario(test::with(test::smallScenario(), "at: [0, 0, -20 mm]", "at: [0, 4 m, 0]")),
                test::smallStructures());
  ASSERT_FALSE(scene);
  EXPECT_THAT(scene.error().what, HasSubstr("the target of state 'mount'"));
}

TEST(SceneBuilder, RefusesPosesOutOfReach) {
  const auto refusal = [](const std::string& from, const std::string& to) {
    const auto scene =
        makeScene(parsedScenario(test::with(test::smallScenario(), from, to)), test::smallStructures());
    return scene ? std::string() : scene.error().what;
  };
  EXPECT_THAT(refusal("at: [0, 0, -20 mm]", "at: [0, 0, -20 m]"),
              HasSubstr("scenario.yaml:16: the target of state 'mount' is 20 m from the world's origin, "
                        "expected at most 'reach', 10 m"));
  EXPECT_THAT(refusal("at: [0.2, 0, 0.1]", "at: [200, 0, 0.1]"),
              HasSubstr("scenario.yaml:4: the start of object 'part' is 200 m from the world's origin"));
  EXPECT_THAT(
      refusal("    hands: {right: part}", "    place: {cube: {at: [0, 30 m, 0]}}\n    hands: {right: part}"),
      HasSubstr("scenario.yaml:16: the place of 'cube' at the begin of state 'mount' is 30 m"));
}

TEST(SceneBuilder, APoseIsOutOfReachByTheObjectsCentre) {
  const Vector3 p_OC_O(15.0, 0.0, 0.0);
  std::vector<test::StructuresPtr> structures = smallStructures();
  structures[1] = test::boxStructuresAt(p_OC_O, Vector3::Constant(0.04), 0.002, 0.005);
  std::string text = test::with(smallScenario(), "at: [0.2, 0, 0.1]", "at: [-14.8, 0, 0.1]");
  text = test::with(text, "at: [0, 0, -20 mm]", "at: [-15 m, 0, -20 mm]");
  const auto scene = makeScene(parsedScenario(text), structures);
  EXPECT_TRUE(scene) << scene.error().what;
  EXPECT_FALSE(makeScene(parsedScenario(smallScenario()), structures))
      << "here the origin is in reach, the part is not";
}

//   part's box, swept back up along its approach
//        +----+
//        |    |  50 mm
//   ---+ |    | +---
//      | +----+ |     target
TEST(SceneBuilder, RefinesAroundTheTargetAndTheApproach) {
  const ScenarioFile scenario = parsedScenario(test::smallScenario());
  const auto boxes = refineBoxes(scenario, scenario.objectNamed("bay"), test::smallStructures());
  ASSERT_EQ(boxes.size(), 1U);
  EXPECT_TRUE(boxes[0].contains(Vector3(0.022, 0, -0.04)));
  EXPECT_TRUE(boxes[0].contains(Vector3(0.0, 0, 0.045)));
  EXPECT_FALSE(boxes[0].contains(Vector3(0.0, 0, 0.065)));
  EXPECT_TRUE(refineBoxes(scenario, scenario.objectNamed("part"), test::smallStructures()).empty());

  const ScenarioFile given = parsedScenario(
      test::with(test::smallScenario(), "refinement: 4",
                 "refinement: 4, refine: [{from: [-0.03, -0.03, -0.05], to: [0.03, 0.03, 0]}]"));
  EXPECT_EQ(refineBoxes(given, given.objectNamed("bay"), test::smallStructures()).size(), 1U)
      << "a given box at the target replaces the automatic one";
}

TEST(SceneBuilder, BakesPartsBeforeTheObjectsTheyAreMountedInto) {
  const ScenarioFile scenario = parsedScenario(test::smallScenario());
  const std::vector<ObjectId> order = bakeOrder(scenario);
  ASSERT_EQ(order.size(), 4U);
  const auto position = [&](const std::string& name) {
    return std::find(order.begin(), order.end(), scenario.objectNamed(name)) - order.begin();
  };
  EXPECT_LT(position("part"), position("bay"));
}

}  // namespace
}  // namespace tenon::game_control
