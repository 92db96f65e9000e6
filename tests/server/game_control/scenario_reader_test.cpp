#include <filesystem>
#include <fstream>
#include <ostream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/game_control/scenario.h"
#include "tests/server/game_control/scenario_text.h"
#include "tests/support/source_folder.h"

namespace tenon::game_control {
namespace {

using test::smallScenario;
using test::with;
using ::testing::HasSubstr;
using ::testing::StartsWith;

Result<ScenarioFile> parsed(const std::string& text) { return parseScenario(text, "small/scenario.yaml"); }

std::filesystem::path shipped(const std::string& name) { return test::sourceFolder() / "scenarios" / name; }

TEST(Scenario, FillsInDefaults) {
  const auto scenario = parsed(test::smallScenario());
  ASSERT_TRUE(scenario) << scenario.error().what;
  EXPECT_EQ(scenario->name, "small");
  EXPECT_EQ(scenario->objectNamed("pointer").value, 2U);
  EXPECT_EQ(scenario->handNamed("instructor").value, 1U);
  EXPECT_EQ(scenario->objects[1].status, ObjectStatus::kHidden);
  EXPECT_DOUBLE_EQ(scenario->objects[0].structures.voxel, 0.001);

  const ScenarioState& take = scenario->states[0];
  EXPECT_EQ(take.object, scenario->objectNamed("part")) << "default: the touched object";
  EXPECT_EQ(take.hand, scenario->handNamed("right"));
  ASSERT_EQ(take.placements.size(), 1U) << "a hidden object is shown when it is to be touched";
  EXPECT_EQ(take.placements[0].kind, PlacementKind::kShow);
  ASSERT_EQ(take.conditions.size(), 2U);
  EXPECT_EQ(take.conditions[1].kind, ConditionKind::kContact);
  EXPECT_EQ(take.conditions[1].limit_ticks, 100U);

  const ScenarioState& mount = scenario->states[1];
  EXPECT_EQ(mount.conditions[1].kind, ConditionKind::kPose);
  EXPECT_EQ(mount.conditions[1].dwell, 50U);
  EXPECT_DOUBLE_EQ(mount.X_WG->translation().z(), -0.02);
  EXPECT_EQ(mount.approach_W, Vector3(0, 0, -1));
  EXPECT_TRUE(mount.snap);
  EXPECT_EQ(mount.timeout, 2000U);
}

TEST(Scenario, ListsEveryPairThatCanCollide) {
  const auto scenario = parsed(test::smallScenario());
  ASSERT_TRUE(scenario);
  EXPECT_EQ(scenario->pairs.size(), 6U) << "all of bay, part, pointer and cube: only the bay never moves";
  const auto grouped =
      parsed(test::with(test::with(test::smallScenario(), "kind: scene", "kind: scene, group: g"),
                        "name: cube,", "name: cube, group: g,"));
  ASSERT_TRUE(grouped) << grouped.error().what;
  EXPECT_EQ(grouped->pairs.size(), 5U) << "objects of one group never collide";
  EXPECT_EQ(grouped->pairOf(grouped->objectNamed("bay"), grouped->objectNamed("cube")), -1);
  const auto off = parsed(test::with(test::smallScenario(), "states:", "pairs_off: [[cube, any]]\nstates:"));
  ASSERT_TRUE(off);
  EXPECT_FALSE(off->pairs[static_cast<std::size_t>(off->pairOf(ObjectId{0}, ObjectId{3}))].enabled);
  EXPECT_TRUE(off->pairs[static_cast<std::size_t>(off->pairOf(ObjectId{0}, ObjectId{1}))].enabled);
}

TEST(Scenario, ReadsShapesAsMeshes) {
  const auto scenario = parsed(test::with(
      test::with(
          test::smallScenario(), "[{part: bay}]",
          "[{box: [20 mm, 3 cm, 0.04]}, {cylinder: {diameter: 10 mm, length: 1 in, deviation: 0.2 mm}, "
          "at: [0, 0, 20 mm], turn: {axis: x, deg: 90}}]"),
      "[{part: pointer}]",
      "[{sphere: {radius: 12 mm}}, {sphere: {diameter: 2 mm}}, {sphere: {diameter: 4}}]"));
  ASSERT_TRUE(scenario) << scenario.error().what;
  ASSERT_EQ(scenario->objects[0].meshes.size(), 2U);
  const Shape& box = scenario->objects[0].meshes[0].shape.value();
  EXPECT_EQ(box.kind, ShapeKind::kBox);
  EXPECT_TRUE(box.size_P.isApprox(Vector3(0.02, 0.03, 0.04), 1e-12));
  EXPECT_TRUE(box.X_OP.translation().isZero());

  const Shape& cylinder = scenario->objects[0].meshes[1].shape.value();
  EXPECT_EQ(cylinder.kind, ShapeKind::kCylinder);
  EXPECT_TRUE(cylinder.size_P.isApprox(Vector3(0.01, 0.01, 0.0254), 1e-12));
  EXPECT_DOUBLE_EQ(cylinder.deviation, 2e-4);
  EXPECT_TRUE((cylinder.X_OP * Vector3(0, 0, 0.01)).isApprox(Vector3(0, -0.01, 0.02), 1e-12));

  const std::vector<MeshSource>& spheres = scenario->objects[2].meshes;
  EXPECT_EQ(spheres[0].shape->kind, ShapeKind::kSphere);
  EXPECT_TRUE(spheres[0].shape->size_P.isApprox(Vector3::Constant(0.024), 1e-12));
  EXPECT_DOUBLE_EQ(spheres[0].shape->deviation, 5e-5) << "0.05 mm";
  EXPECT_DOUBLE_EQ(spheres[1].shape->deviation, 1e-5) << "1 % of a small radius";
  EXPECT_DOUBLE_EQ(spheres[2].shape->deviation, 2e-4) << "0.01 % of a large radius";
  EXPECT_FALSE(scenario->objects[1].meshes[0].shape) << "a part";
}

TEST(Scenario, StatesItsSetOfParts) {
  EXPECT_EQ(parsed(test::smallScenario())->part_set, "");
  const auto stated =
      parsed(test::with(test::smallScenario(), "title: Small", "title: Small\nparts: stacking"));
  ASSERT_TRUE(stated) << stated.error().what;
  EXPECT_EQ(stated->part_set, "stacking");
  EXPECT_EQ(stated->part_set_line, 2);
}

TEST(Scenario, ReadsUnitsRotationsAndQuaternions) {
  const auto turned = parsed(test::with(
      test::smallScenario(), "start: {at: [0.2, 0, 0.1]}",
      "start: {at: [20 cm, 1 in, 100mm], turn: [{axis: x, deg: 90}, {axis: [0, 0, 2], deg: 270}]}"));
  ASSERT_TRUE(turned) << turned.error().what;
  const Pose& X_WO = turned->objects[1].X_WO;
  EXPECT_TRUE(X_WO.translation().isApprox(Vector3(0.2, 0.0254, 0.1), 1e-12));
  // 90 degrees about x take y to z and z to -y; 270 degrees about z then take -y to -x
  EXPECT_TRUE((X_WO.rotation() * Vector3::UnitY()).isApprox(Vector3::UnitZ(), 1e-12));
  EXPECT_TRUE((X_WO.rotation() * Vector3::UnitZ()).isApprox(-Vector3::UnitX(), 1e-12));
  const auto quaternion = parsed(
      test::with(test::smallScenario(), "start: {at: [0.2, 0, 0.1]}", "start: {q: [0.7071, 0.7071, 0, 0]}"));
  ASSERT_TRUE(quaternion) << quaternion.error().what;
  EXPECT_NEAR(quaternion->objects[1].X_WO.rotation().norm(), 1.0, 1e-15);
}

TEST(Scenario, KeepsTextsOfAllLanguagesTheMainOneFirst) {
  const auto scenario =
      parsed(test::with(test::smallScenario(), "title: Small", "title: {de: Klein, en: Small}"));
  ASSERT_TRUE(scenario) << scenario.error().what;
  ASSERT_EQ(scenario->title.size(), 2U);
  EXPECT_EQ(scenario->title[0].text, "Small");
  EXPECT_EQ(scenario->title[1].language, "de");
}

TEST(Scenario, ReadsATreeOfConditions) {
  const std::string conditions = R"(    conditions:
      any:
        - all:
            - {pose: target, dwell: 0.2 s}
            - {force: {below: 5 N}}
            - {contact_time: {at_least: 0.5 s}}
          when: latched
        - {force: {target: [0, 0, 10], within: 1 N}}
        - {contact: {between: [cube, part], for: 1 s, lapse: 10 ms}}
        - {command: fulfilled}
        - {signal: gripper_closed}
    snap: true)";
  const auto scenario = parsed(
      test::with(test::with(test::smallScenario(), ", dwell: 50 ms", ""), "    snap: true", conditions));
  ASSERT_TRUE(scenario) << scenario.error().what;
  const std::vector<Condition>& tree = scenario->states[1].conditions;
  ASSERT_EQ(tree.size(), 9U);
  EXPECT_EQ(tree[0].kind, ConditionKind::kAny);
  EXPECT_TRUE(tree[1].latched);
  EXPECT_EQ(tree[2].parent, 1U);
  EXPECT_EQ(tree[2].dwell, 200U);
  EXPECT_DOUBLE_EQ(tree[3].below, 5.0);
  EXPECT_EQ(tree[4].limit_ticks, 500U);
  EXPECT_EQ(tree[5].parent, 0U);
  EXPECT_EQ(tree[5].F_W.z(), 10.0);
  EXPECT_EQ(tree[6].lapse, 10U);
  EXPECT_EQ(scenario->signalNamed("gripper_closed"), 0);
}

TEST(Scenario, ReadsPlacementsAndPairSwitchesOfAState) {
  const std::string effects =
      "    fix: {cube: {at: [0.4, 0, 0]}}\n    free: [part]\n    hide: [pointer]\n    pairs_off: [[part, "
      "cube]]\n    snap: true";
  const auto scenario = parsed(test::with(test::smallScenario(), "    snap: true", effects));
  ASSERT_TRUE(scenario) << scenario.error().what;
  const ScenarioState& mount = scenario->states[1];
  ASSERT_EQ(mount.placements.size(), 3U);
  EXPECT_EQ(mount.placements[0].kind, PlacementKind::kFix);
  EXPECT_DOUBLE_EQ(mount.placements[0].X_WO->translation().x(), 0.4);
  EXPECT_EQ(mount.placements[1].kind, PlacementKind::kFree);
  EXPECT_EQ(mount.placements[2].kind, PlacementKind::kHide);
  ASSERT_EQ(mount.pairs.size(), 1U);
  EXPECT_FALSE(mount.pairs[0].enabled);
}

TEST(Scenario, ReadsGroupChangesOfAState) {
  const std::string grouped = test::with(test::smallScenario(), "name: cube,", "name: cube, group: kit,");
  const auto scenario =
      parsed(test::with(grouped, "    snap: true", "    groups: {part: kit, cube: none}\n    snap: true"));
  ASSERT_TRUE(scenario) << scenario.error().what;
  EXPECT_EQ(scenario->groups, std::vector<std::string>{"kit"});
  EXPECT_EQ(scenario->objects[3].group, 1U);
  const std::vector<GroupChange>& changes = scenario->states[1].groups;
  ASSERT_EQ(changes.size(), 2U);
  EXPECT_EQ(changes[0].object, scenario->objectNamed("part"));
  EXPECT_EQ(changes[0].group, 1U);
  EXPECT_EQ(changes[1].object, scenario->objectNamed("cube"));
  EXPECT_EQ(changes[1].group, 0U);
  EXPECT_EQ(changes[1].line, 21);
}

TEST(Scenario, ListsPairsOfAGroupThatAnObjectLeaves) {
  const std::string grouped =
      test::with(test::with(test::smallScenario(), "kind: scene", "kind: scene, group: g"), "name: cube,",
                 "name: cube, group: g,");
  const auto left = parsed(test::with(grouped, "    snap: true", "    groups: {cube: none}\n    snap: true"));
  ASSERT_TRUE(left) << left.error().what;
  EXPECT_EQ(left->pairs.size(), 6U);
  EXPECT_GE(left->pairOf(left->objectNamed("bay"), left->objectNamed("cube")), 0);
}

struct BadInput {
  std::string name, from, to, line, expected;
  friend void PrintTo(const BadInput& input, std::ostream* out) { *out << input.name; }
};

class ScenarioErrors : public ::testing::TestWithParam<BadInput> {};

TEST_P(ScenarioErrors, NameFileLineAndReason) {
  const BadInput& input = GetParam();
  const std::string text = test::with(test::smallScenario(), input.from, input.to);
  ASSERT_NE(text, test::smallScenario()) << "the test changes nothing";
  const auto scenario = parsed(text);
  ASSERT_FALSE(scenario);
  EXPECT_THAT(scenario.error().what, StartsWith("small/scenario.yaml:" + input.line + ": "));
  EXPECT_THAT(scenario.error().what, HasSubstr(input.expected));
}

const BadInput kBadInputs[] = {
    {"syntax", "hands:", "hands: [", "8", "not valid YAML"},
    {"unknown_key", "snap: true", "snapp: true", "21", "unknown key 'snapp'; did you mean 'snap'?"},
    {"unknown_key_far", "title: Small", "zzzzzzzz: 1", "1", "known keys: title, language"},
    {"key_twice", "title: Small", "title: Small\ntitle: Other", "2", "two keys 'title'"},
    {"not_a_mapping", "  - {name: right, object: pointer}", "  - right", "8", "a hand must be a mapping"},
    {"object_twice", "name: cube,", "name: part,", "6", "two objects are named 'part', the first in line 4"},
    {"hand_twice", "name: instructor, role", "name: right, role", "9", "two hands are named 'right'"},
    {"state_twice", "name: mount", "name: take", "16", "two states are named 'take', the first in line 13"},
    {"name_missing", "name: right, ", "", "8", "'name' of a hand is missing"},
    {"object_of_hand", "object: cube}", "object: cubee}", "9",
     "unknown object 'cubee'; did you mean 'cube'?"},
    {"touch_unknown", "touch: part", "touch: prat", "14", "unknown object 'prat'; did you mean 'part'?"},
    {"hand_unknown", "hands: {right: part}", "hands: {rihgt: part}", "17",
     "unknown hand 'rihgt'; did you mean 'right'?"},
    {"kind_unknown", "kind: scene", "kind: scenery", "3", "expected one of: part, tool"},
    {"status_unknown", "status: fixed", "status: stuck", "3", "expected one of: hidden, parked"},
    {"color", "kind: scene", "kind: scene, color: red", "3", "expected '#rrggbb'"},
    {"no_mesh", ", meshes: [{part: cube}]", "", "6", "'meshes' of object 'cube' is missing"},
    {"mesh_file", "[{part: bay}]", "[{file: none.stl}]", "3", "has no mesh file small/none.stl"},
    {"mesh_both", "[{part: bay}]", "[{part: bay, file: a.stl}]", "3",
     "has several of part, file, box, sphere and cylinder, expected one"},
    {"mesh_none", "[{part: bay}]", "[{unit: mm}]", "3", "has none of part, file, box"},
    {"mesh_unknown", "[{part: bay}]", "[{cube: 2}]", "3", "unknown key 'cube'"},
    {"mesh_two_shapes", "[{part: bay}]", "[{box: [1, 1, 1], sphere: {radius: 1}}]", "3",
     "has several of part"},
    {"part_unit", "[{part: bay}]", "[{part: bay, unit: mm}]", "3",
     "'unit' of 'meshes' of object 'bay' is for files"},
    {"box_unit", "[{part: bay}]", "[{box: [1, 1, 1], unit: mm}]", "3", "is for files only"},
    {"part_moved", "[{part: bay}]", "[{part: bay, at: [0, 0, 1]}]", "3",
     "'at' of 'meshes' of object 'bay' is for a box"},
    {"box_edges", "[{part: bay}]", "[{box: [1, 1]}]", "3", "edge lengths along x, y and z, such as [20 mm"},
    {"box_number", "[{part: bay}]", "[{box: 1}]", "3", "edge lengths along x, y and z"},
    {"box_flat", "[{part: bay}]", "[{box: [1, 0, 1]}]", "3", "expected between 0.0001 and 20 m"},
    {"box_unit_word", "[{part: bay}]", "[{box: [1 mm, 1 km, 1]}]", "3", "is '1 km', expected a length"},
    {"sphere_number", "[{part: bay}]", "[{sphere: 12 mm}]", "3",
     "must be a mapping such as {diameter: 24 mm}"},
    {"sphere_size", "[{part: bay}]", "[{sphere: {}}]", "3", "needs either 'diameter' or 'radius'"},
    {"sphere_sizes", "[{part: bay}]", "[{sphere: {radius: 1, diameter: 2}}]", "3", "needs either 'diameter'"},
    {"sphere_key", "[{part: bay}]", "[{sphere: {diametre: 2}}]", "3", "did you mean 'diameter'?"},
    {"sphere_large", "[{part: bay}]", "[{sphere: {radius: 11}}]", "3", "expected between 5e-05 and 10 m"},
    {"sphere_fine", "[{part: bay}]", "[{sphere: {radius: 1, deviation: 1e-6}}]", "3",
     "'deviation' of 'sphere' of object 'bay' is 1e-6, expected between 1e-05 and 0.2 m"},
    {"cylinder_number", "[{part: bay}]", "[{cylinder: [1, 2]}]", "3",
     "such as {diameter: 10 mm, length: 40 mm}"},
    {"cylinder_length", "[{part: bay}]", "[{cylinder: {radius: 1}}]", "3",
     "'length' of 'cylinder' of object 'bay' is missing"},
    {"cylinder_coarse", "[{part: bay}]", "[{cylinder: {radius: 1, length: 1, deviation: 0.5}}]", "3",
     "expected between"},
    {"parts_list", "title: Small", "parts: [a, b]", "1", "'parts' must be a text"},
    {"length_unit", "within: 2 mm", "within: 2 km", "19", "expected a length such as 2 mm"},
    {"angle_without_unit", "angle: 2 deg", "angle: 2", "19", "expected an angle with its unit"},
    {"not_finite", "at: [0, 0, -20 mm]", "at: [0, 0, nan]", "19", "is 'nan'"},
    {"inside_out", "within: 2 mm", "within: -2 mm", "19", "expected between"},
    {"angle_too_large", "angle: 2 deg", "angle: 400 deg", "19", "expected between"},
    {"vector", "at: [0, 0, -20 mm]", "at: [0, 0]", "19", "a list of three numbers"},
    {"quaternion", "at: [0, 0, -20 mm]", "at: [0, 0, 0], q: [1, 1, 0, 0]", "19",
     "expected a unit quaternion"},
    {"turn_and_q", "at: [0, 0, -20 mm]", "at: [0, 0, 0], q: [1, 0, 0, 0], turn: {axis: x, deg: 1}", "19",
     "both 'turn' and 'q'"},
    {"axis", "at: [0, 0, -20 mm]", "at: [0, 0, 0], turn: {axis: [0, 0, 0], deg: 1}", "19", "has length 0"},
    {"refinement", "refinement: 4", "refinement: 3", "3", "must be 1, 2, 4 or 8"},
    {"box", "refinement: 4", "refine: [{from: [0, 0, 1], to: [1, 1, 0]}]", "3", "is empty"},
    {"pair_twice", "pairs:", "pairs:\n  - {between: [bay, part]}", "12", "listed twice, first in line 11"},
    {"pair_itself", "between: [part, bay]", "between: [part, part]", "11", "names 'part' twice"},
    {"friction_too_large", "clearance: 4 mm", "clearance: 4 mm, friction: 3", "11",
     "expected between 0 and 2"},
    {"sliding_friction_too_large", "clearance: 4 mm", "clearance: 4 mm, friction: 0.3, sliding_friction: 0.4",
     "11", "expected between 0 and 0.3"},
    {"dilation", "clearance: 4 mm", "clearance: 4 mm, dilation: 2 mm", "11",
     "a pair has the key 'dilation', which is no more: thin walls are kept solid where they are"},
    {"dilation_of_structures", "refinement: 4", "refinement: 4, dilation: 2 mm", "3",
     "has the key 'dilation', which is no more: thin walls are kept solid where they are"},
    {"target_missing",
     "    target: {at: [0, 0, -20 mm], within: 2 mm, angle: 2 deg, dwell: 50 ms}\n    approach: {direction: "
     "[0, 0, -1], distance: 50 mm}\n",
     "", "19", "snaps 'part', but has no target pose"},
    {"target_without_at", "at: [0, 0, -20 mm], ", "", "19", "has no 'at'"},
    {"target_nobody", "    hands: {right: part}\n", "", "18", "no hand moves 'part'"},
    {"target_without_object", "    object: part\n", "", "18", "no 'object' to bring there"},
    {"hidden", "touch: part\n    for: 0.1 s", "object: part", "13", "'part' is hidden"},
    {"hand_of_other", "hands: {right: part}", "hands: {right: cube}", "17",
     "is the default object of hand 'instructor'"},
    {"approach", "direction: [0, 0, -1]", "direction: [0, 0, 0]", "20", "has length 0"},
    {"timeout_word", "timeout: 2 s", "timeout: 2 s\n    on_timeout: retry", "23",
     "expected 'fail' or 'skip'"},
    {"timeout_short", "for: 0.1 s", "for: 10 s\n    timeout: 1 s", "16",
     "shorter than its conditions require"},
    {"for_without_touch", "snap: true", "for: 1 s", "21", "belongs to a 'touch'"},
    {"conditions_two", "snap: true", "conditions: {command: fulfilled, signal: x}", "21", "has 2 of"},
    {"conditions_empty", "snap: true", "conditions: {all: []}", "21", "is empty"},
    {"conditions_when", "snap: true", "conditions: {all: [{command: fulfilled}], when: maybe}", "21",
     "expected 'together' or 'latched'"},
    {"conditions_dwell", "snap: true", "conditions: {command: fulfilled, dwell: 1 s}", "21",
     "lasts one tick"},
    {"conditions_force", "snap: true", "conditions: {force: {above: 5 N, below: 2 N}}", "21",
     "'above' < 'below'"},
    {"conditions_force_none", "snap: true", "conditions: {force: {}}", "21", "needs either 'above'"},
    {"conditions_pose", "snap: true", "conditions: {pose: {object: cube}}", "21",
     "expected a 'target' of its own"},
    {"conditions_command", "snap: true", "conditions: {command: done}", "21", "expected 'fulfilled'"},
    {"conditions_deep", "snap: true",
     "conditions: {all: [{all: [{all: [{all: [{all: [{all: [{all: [{all: [{all: [{command: "
     "fulfilled}]}]}]}]}]}]}]}]}]}",
     "21", "nested more than"},
    {"conditions_itself", "snap: true", "conditions: &loop {all: [*loop]}", "21", ""},
    {"language", "title: Small", "title: {de: Klein}", "1", "no text in 'en'"},
    {"groups_list", "snap: true", "groups: [part]", "21",
     "'groups' of state 'mount' must be a mapping from object"},
    {"groups_object", "snap: true", "groups: {prat: kit, cube: kit}", "21",
     "unknown object 'prat'; did you mean 'part'?"},
    {"groups_name", "snap: true", "groups:\n      part: [kit]\n      cube: kit", "22",
     "'groups' of state 'mount', object 'part',"},
    {"groups_twice", "snap: true", "groups: {part: kit, cube: kit, part: none}", "21", "names 'part' twice"},
    {"groups_alone", "snap: true", "groups:\n      cube: kit\n      bay: kit\n      part: kitt", "24",
     "'groups' of state 'mount' puts 'part' into 'kitt', which no other object is ever in; did you mean "
     "'kit'?"},
    {"groups_touch", "touch: part\n", "touch: part\n    groups: {part: kit, pointer: kit}\n", "13",
     "state 'take' requires contact of 'pointer' and 'part', but both are in group 'kit'"},
    {"groups_may_take", "snap: true", "groups: {part: kit, cube: kit}\n    may_take: {instructor: part}",
     "22", "'cube' and 'part' never collide"},
    {"states_empty", "states:", "states: []\nother:", "13", "unknown key 'other'"},
};

INSTANTIATE_TEST_SUITE_P(BadInputs, ScenarioErrors, ::testing::ValuesIn(kBadInputs),
                         [](const auto& input) { return input.param.name; });

TEST(Scenario, RefusesTheFormerKeyFeltInOneLine) {
  const auto scenario =
      parsed(test::with(test::smallScenario(), "kind: assistant", "kind: assistant, felt: false"));
  ASSERT_FALSE(scenario);
  EXPECT_EQ(scenario.error().what,
            "small/scenario.yaml:6: an object has a key with an old name: 'felt' is now 'collidable'");
}

TEST(Scenario, AnObjectThatIsNotCollidableHasNoPairs) {
  const auto scenario =
      parsed(test::with(test::smallScenario(), "kind: assistant", "kind: assistant, collidable: false"));
  ASSERT_TRUE(scenario) << scenario.error().what;
  EXPECT_FALSE(scenario->objects[3].collidable);
  EXPECT_TRUE(scenario->objects[0].collidable) << "default";
  EXPECT_EQ(scenario->pairs.size(), 3U);
}

TEST(Scenario, NamesAMissingFile) {
  const auto scenario = readScenario("/nowhere/scenario.yaml");
  ASSERT_FALSE(scenario);
  EXPECT_THAT(scenario.error().what, HasSubstr("/nowhere/scenario.yaml: no such scenario file"));
}

TEST(Scenario, ReadsPegAndBox) {
  const auto scenario = readScenario(shipped("peg_and_box"));
  ASSERT_TRUE(scenario) << scenario.error().what;
  EXPECT_EQ(scenario->name, "peg_and_box");
  EXPECT_EQ(scenario->objects.size(), 4U);
  EXPECT_EQ(scenario->states.size(), 2U);
  EXPECT_DOUBLE_EQ(scenario->pairs[0].clearance, 0.5e-3);
}

}  // namespace
}  // namespace tenon::game_control
