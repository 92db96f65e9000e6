#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/game_control/scenario.h"
#include "tests/server/game_control/scenario_text.h"
#include "tests/support/analytic_structures.h"
#include "tests/support/source_folder.h"

namespace tenon::game_control {
namespace {

using test::smallScenario;
using test::with;
using ::testing::HasSubstr;

Result<ScenarioFile> withBody(const std::string& body) {
  return parseScenario(test::with(test::smallScenario(), "structures: {voxel: 2 mm}}",
                                  "structures: {voxel: 2 mm}, body: " + body + "}"),
                       "small/scenario.yaml");
}

TEST(ScenarioBodies, AnObjectWithABodyIsFreeUnlessItsStatusIsGiven) {
  const std::string text =
      test::with(test::smallScenario(), "status: hidden,", "body: {mass: 250 g, friction: 0.3},");
  const auto scenario = parseScenario(text, "small/scenario.yaml");
  ASSERT_TRUE(scenario) << scenario.error().what;
  const ScenarioObject& part = scenario->objects[1];
  EXPECT_EQ(part.status, ObjectStatus::kFree);
  ASSERT_TRUE(part.body);
  EXPECT_DOUBLE_EQ(*part.body->mass, 0.25);
  EXPECT_DOUBLE_EQ(part.body->friction, 0.3);
  EXPECT_EQ(scenario->gravity_W, Vector3(0.0, 0.0, -9.81));
  EXPECT_EQ(withBody("{density: 2.7 g/cm3}")->objects[1].status, ObjectStatus::kHidden);
  EXPECT_DOUBLE_EQ(withBody("{density: 2.7 g/cm3}")->objects[1].body->density, 2700.0);
}

TEST(ScenarioBodies, AFreeBodyIsPairedWithFixedObjects) {
  const std::string text = test::with(test::smallScenario(), "status: hidden,", "body: {mass: 250 g},");
  const auto scenario = parseScenario(
      test::with(
          text,
          "    hands: {right: part}\n    object: part\n    target: {at: [0, 0, -20 mm], within: 2 mm, angle: "
          "2 deg, dwell: 50 ms}\n    approach: {direction: [0, 0, -1], distance: 50 mm}\n    snap: true\n",
          ""),
      "small/scenario.yaml");
  ASSERT_TRUE(scenario) << scenario.error().what;
  EXPECT_GE(scenario->pairOf(ObjectId{1}, ObjectId{0}), 0);
}

TEST(ScenarioBodies, ErrorsNameFileLineAndReason) {
  struct Case {
    const char* body;
    const char* expected;
  };
  for (const Case& one : {
           Case{"{}", "needs either 'mass' or 'density'"},
           Case{"{mass: 1 kg, density: 1000 kg/m3}", "needs either 'mass' or 'density'"},
           Case{"{mass: heavy}", "expected a mass such as 0.4 kg"},
           Case{"{mass: 0 kg}", "expected between 1e-06 and 10000 kg"},
           Case{"{density: 2.7 kg/l}", "expected a density such as 2700 kg/m3"},
           Case{"{mass: 1 kg, inertia: [1, 1, 1]}", "needs 'mass' and 'centre' with it"},
           Case{"{mass: 1 kg, centre: [0, 0, 0], inertia: [1, 1, 3]}", "is not physical"},
           Case{"{mass: 1 kg, centre: [0, 0, 0], inertia: [1e-110, 1e-110, 1e-110]}",
                "does not fit its mass"},
           Case{"{mass: 1 kg, friction: -1}", "'friction' of 'body' of object 'part'"},
           Case{"{mass: 1 kg, frction: 1}", "did you mean 'friction'?"},
           Case{"1 kg", "must be a mapping"},
           Case{"{mass: 1 kg}, collidable: false", "'part' is not collidable"},
       }) {
    const auto scenario = withBody(one.body);
    ASSERT_FALSE(scenario) << one.body;
    EXPECT_THAT(scenario.error().what, HasSubstr("small/scenario.yaml:4: ")) << one.body;
    EXPECT_THAT(scenario.error().what, HasSubstr(one.expected)) << one.body;
  }
  const auto massless = parseScenario(test::with(test::smallScenario(), "status: hidden", "status: free"),
                                      "small/scenario.yaml");
  ASSERT_FALSE(massless);
  EXPECT_THAT(massless.error().what, HasSubstr("'part' is free but has no 'body'"));
}

TEST(ScenarioBodies, MassAndInertiaAreComputedFromTheVolume) {
  const Vector3 size(0.04, 0.06, 0.1);
  const auto structures = test::boxStructures(size, 0.002, 0.01);
  ScenarioObject object;
  object.name = "box";
  object.body.emplace();
  object.body->density = 1000.0;
  const auto body = bodyOf(object, *structures);
  ASSERT_TRUE(body);
  EXPECT_NEAR(body->mass, 0.24, 0.002);
  EXPECT_NEAR(body->inertia_C_O(2, 2), 0.24 / 12.0 * (0.04 * 0.04 + 0.06 * 0.06), 4e-6);
  EXPECT_LE(body->p_OC_O.norm(), 1e-5);
}

TEST(ScenarioBodies, TheBlocksOfStackingAreFree) {
  const auto scenario = readScenario(test::sourceFolder() / "scenarios" / "stacking");
  ASSERT_TRUE(scenario) << scenario.error().what;
  for (const char* block : {"red", "green", "blue"}) {
    const ScenarioObject& object = scenario->objects[scenario->objectNamed(block).value];
    EXPECT_EQ(object.status, ObjectStatus::kFree);
    EXPECT_GE(scenario->pairOf(scenario->objectNamed(block), scenario->objectNamed("table")), 0);
  }
}

TEST(ScenarioBodies, AnObjectWithoutVolumeNeedsItsInertia) {
  ScenarioObject object;
  object.name = "sheet";
  object.body.emplace();
  object.body->mass = 1.0;
  const auto body = bodyOf(object, structures::HapticStructures{});
  ASSERT_FALSE(body);
  EXPECT_THAT(body.error().what, HasSubstr("'sheet' encloses no volume"));
}

}  // namespace
}  // namespace tenon::game_control
