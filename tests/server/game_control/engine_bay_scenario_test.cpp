#include <algorithm>
#include <filesystem>
#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "scenarios/part_generator/engine_bay_layout.h"
#include "server/game_control/scenario.h"
#include "tests/support/source_folder.h"

namespace tenon::game_control {
namespace {

ScenarioFile engineBay() {
  auto scenario = readScenario(test::sourceFolder() / "scenarios" / "engine_bay");
  EXPECT_TRUE(scenario) << scenario.error().what;
  return scenario ? *std::move(scenario) : ScenarioFile{};
}

const ScenarioState& stateNamed(const ScenarioFile& scenario, const std::string& name) {
  const auto found = std::find_if(scenario.states.begin(), scenario.states.end(),
                                  [&](const ScenarioState& state) { return state.name == name; });
  EXPECT_NE(found, scenario.states.end()) << name;
  return *found;
}

void expectSamePose(const Pose& given, const Pose& expected, const std::string& what) {
  EXPECT_LT((given.translation() - expected.translation()).norm(), 1e-4) << what;
  EXPECT_LT(angleBetween(given.rotation(), expected.rotation()), 1e-4) << what;
}

TEST(EngineBayScenario, HasTheTenObjectsOfThePaper) {
  const ScenarioFile scenario = engineBay();
  const auto is_head = [](const ScenarioObject& object) { return object.kind == "head"; };
  EXPECT_EQ(std::count_if(scenario.objects.begin(), scenario.objects.end(), std::not_fn(is_head)), 10)
      << "besides the user's head, an avatar that collides with nothing";
  EXPECT_EQ(scenario.states.size(), 15U) << "take, mount and tool for each of five parts";
}

TEST(EngineBayScenario, HasThePosesOfTheGenerator) {
  const ScenarioFile scenario = engineBay();
  for (const part_generator::engine_bay::PartLayout& part : part_generator::engine_bay::parts()) {
    const std::string name(part.name);
    const ScenarioState& mount = stateNamed(scenario, "mount_" + name);
    expectSamePose(*mount.X_WG, part_generator::engine_bay::targetPose(part), name);
    EXPECT_EQ(mount.approach_W, part_generator::engine_bay::approachDirection(part.approach)) << name;
    EXPECT_DOUBLE_EQ(mount.approach_distance, part_generator::engine_bay::kApproachDistance);
    expectSamePose(*stateNamed(scenario, "tool_" + name).X_WG, part_generator::engine_bay::toolPose(part),
                   "drill at " + name);
    const ObjectId object = scenario.objectNamed(name);
    expectSamePose(scenario.objects[object.value].X_WO, part_generator::engine_bay::startPose(part),
                   "start of " + name);
  }
  for (const part_generator::engine_bay::OtherObject& other : part_generator::engine_bay::others()) {
    const ObjectId object = scenario.objectNamed(other.name);
    ASSERT_TRUE(object.valid()) << other.name;
    expectSamePose(scenario.objects[object.value].X_WO, other.X_WO, std::string(other.name));
  }
}

TEST(EngineBayScenario, RefinesThePockets) {
  const ScenarioFile scenario = engineBay();
  const ObjectId bay = scenario.objectNamed("engine_bay");
  for (std::size_t i = 0; i < part_generator::engine_bay::parts().size(); ++i) {
    const part_generator::engine_bay::PartLayout& part = part_generator::engine_bay::parts()[i];
    const int index = scenario.pairOf(scenario.objectNamed(part.name), bay);
    ASSERT_GE(index, 0);
    const ScenarioPair& pair = scenario.pairs[static_cast<std::size_t>(index)];
    EXPECT_DOUBLE_EQ(pair.clearance, part_generator::engine_bay::kClearance) << part.name;
    const Eigen::AlignedBox3d needed = part_generator::engine_bay::refineBox(part);
    const Eigen::AlignedBox3d& given = scenario.objects[bay.value].structures.refine[i];
    EXPECT_LT((given.min() - needed.min()).cwiseAbs().maxCoeff(), 1e-3) << part.name;
    EXPECT_LT((given.max() - needed.max()).cwiseAbs().maxCoeff(), 1e-3) << part.name;
  }
}

TEST(EngineBayScenario, HasEnglishAndGermanTextsInEveryState) {
  const ScenarioFile scenario = engineBay();
  ASSERT_GT(scenario.states.size(), 5U);
  for (const ScenarioState& state : scenario.states) {
    for (const Texts* texts : {&state.title, &state.instruction}) {
      ASSERT_EQ(texts->size(), 2U) << state.name;
      EXPECT_EQ((*texts)[0].language, "en") << state.name;
      EXPECT_EQ((*texts)[1].language, "de") << state.name;
    }
  }
}

}  // namespace
}  // namespace tenon::game_control
