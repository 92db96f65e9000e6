#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "server/game_control/scenario.h"
#include "tests/support/source_folder.h"

namespace tenon::game_control {
namespace {

std::string textOf(const std::string& scenario) {
  std::ifstream file(test::sourceFolder() / "scenarios" / scenario / "scenario.yaml");
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// Applies one to four random edits: a byte replaced, inserted or erased, a piece erased or duplicated
/// elsewhere.
std::string damaged(std::string text, std::mt19937_64& random) {
  constexpr char kTroublesome[] = "{}[]:,&*!|>'\"%@`-#\n\t 0aZ\0\x80\xff";
  for (std::uint64_t edit = 1 + random() % 4; edit > 0; --edit) {
    const std::size_t at = random() % text.size();
    const std::size_t length = std::min<std::size_t>(1 + random() % 30, text.size() - at);
    const char byte = kTroublesome[random() % (sizeof(kTroublesome) - 1)];
    switch (random() % 4) {
      case 0:
        text[at] = byte;
        break;
      case 1:
        text.insert(at, 1, byte);
        break;
      case 2:
        text.erase(at, length);
        break;
      default:
        text.insert(random() % text.size(), text.substr(at, length));
        break;
    }
    if (text.empty()) text = "x";
  }
  return text;
}

void readDamaged(const std::string& scenario, int times, std::uint64_t seed) {
  const std::string text = textOf(scenario);
  ASSERT_FALSE(text.empty());
  std::mt19937_64 random(seed);
  int refused = 0;
  for (int i = 0; i < times; ++i) {
    const auto result = parseScenario(damaged(text, random), "damaged/scenario.yaml");
    if (result) continue;
    ++refused;
    EXPECT_EQ(result.error().what.rfind("damaged/scenario.yaml:", 0), 0U) << result.error().what;
  }
  EXPECT_GT(refused, times / 4) << "most damage is noticed";
}

TEST(ScenarioFuzz, ADamagedPegAndBoxIsReadOrRefusedWithoutACrash) { readDamaged("peg_and_box", 1500, 1); }

TEST(ScenarioFuzz, ADamagedEngineBayIsReadOrRefusedWithoutACrash) { readDamaged("engine_bay", 500, 2); }

}  // namespace
}  // namespace tenon::game_control
