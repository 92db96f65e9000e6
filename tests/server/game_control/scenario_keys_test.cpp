#include "server/game_control/scenario_keys.h"

#include <filesystem>
#include <fstream>
#include <set>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/source_folder.h"

namespace tenon::game_control {
namespace {

TEST(ScenarioSchema, HasExactlyTheKeysOfTheReader) {
  std::ifstream file(test::sourceFolder() / "scenarios" / "scenario.schema.json");
  const nlohmann::json schema = nlohmann::json::parse(file);
  std::set<std::string> mappings;
  for (const ScenarioMapping& mapping : scenarioMappings()) {
    const std::string name(mapping.name);
    mappings.insert(name);
    ASSERT_TRUE(schema["$defs"].contains(name)) << name;
    const nlohmann::json& definition = schema["$defs"][name];
    EXPECT_EQ(definition["additionalProperties"], false) << name;
    std::set<std::string> in_schema;
    for (const auto& property : definition["properties"].items()) in_schema.insert(property.key());
    EXPECT_EQ(in_schema, std::set<std::string>(mapping.keys.begin(), mapping.keys.end())) << name;
  }
  for (const auto& definition : schema["$defs"].items()) {
    if (!definition.value().contains("properties")) continue;
    EXPECT_TRUE(mappings.contains(definition.key())) << definition.key();
  }
}

TEST(ScenarioKeys, SuggestsTheNearestWordWhenItIsNear) {
  constexpr std::string_view kWords[] = {"touch", "target", "timeout"};
  EXPECT_EQ(suggestion("tuch", kWords), "did you mean 'touch'?");
  EXPECT_EQ(suggestion("tiemout", kWords), "did you mean 'timeout'?");
  EXPECT_EQ(suggestion("gravity", kWords), "");
  EXPECT_EQ(suggestion(std::string(10'000, 't'), kWords), "");
}

TEST(ScenarioKeys, TheFormerNameOfAKeyLeadsToItsPresentName) {
  EXPECT_EQ(renamedKey("object", "felt"), "collidable");
  EXPECT_EQ(renamedKey("object", "group"), "");
  EXPECT_EQ(renamedKey("hand", "felt"), "");
}

}  // namespace
}  // namespace tenon::game_control
