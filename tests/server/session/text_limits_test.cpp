#include "server/game_control/text_limits.h"

#include <functional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/types/messages/objects.h"
#include "idl/types/messages/session.h"
#include "idl/types/messages/steps.h"
#include "idl/wire/codec.h"
#include "server/game_control/scenario.h"
#include "tests/server/game_control/scenario_text.h"

namespace tenon::session {
namespace {

using game_control::kMaxHandName, game_control::kMaxInstruction, game_control::kMaxKind,
    game_control::kMaxLanguage;
using game_control::kMaxLanguages, game_control::kMaxObjectName, game_control::kMaxSignalName;
using game_control::kMaxStateName, game_control::kMaxStateTitle, game_control::kMaxTitle;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// The largest number of bytes that a message can have in a text.
std::size_t mostThatFits(const std::function<bool(const std::string&)>& can_be_sent) {
  std::size_t most = 0;
  while (most < 300 && can_be_sent(std::string(most + 1, 'x'))) ++most;
  return most;
}

TEST(TextLimits, AreThoseOfTheMessages) {
  const auto state = [](const auto& set) {
    return mostThatFits([&](const std::string& text) {
      StepState step;
      set(step, text);
      return wire::encode(step).has_value();
    });
  };
  EXPECT_EQ(state([](StepState& step, const std::string& text) {
              step.instruction = {{"en", text}};
            }),
            kMaxInstruction);
  EXPECT_EQ(state([](StepState& step, const std::string& text) {
              step.title = {{"en", text}};
            }),
            kMaxStateTitle);
  EXPECT_EQ(state([](StepState& step, const std::string& text) {
              step.title = {{text, "a"}};
            }),
            kMaxLanguage);
  EXPECT_EQ(state([](StepState& step, const std::string& text) { step.title.resize(text.size()); }),
            kMaxLanguages);
  EXPECT_EQ(state([](StepState& step, const std::string& text) { step.name = text; }), kMaxStateName);
  EXPECT_EQ(state([](StepState& step, const std::string& text) { step.part = text; }), kMaxStateName);
  const auto object = [](std::string SceneObject::*member) {
    return mostThatFits([&](const std::string& text) {
      SceneObject message;
      message.*member = text;
      return wire::encode(message).has_value();
    });
  };
  EXPECT_EQ(object(&SceneObject::name), kMaxObjectName);
  EXPECT_EQ(object(&SceneObject::title), kMaxTitle);
  EXPECT_EQ(object(&SceneObject::kind), kMaxKind);
  EXPECT_EQ(mostThatFits([](const std::string& text) {
              return wire::encode(SceneObject{.titles = {{"en", text}}}).has_value();
            }),
            kMaxTitle);
  EXPECT_EQ(mostThatFits([](const std::string& text) {
              return wire::encode(SceneHand{HandId{0}, text, Role::kTrainee, ObjectId{0}}).has_value();
            }),
            kMaxHandName);
  EXPECT_EQ(mostThatFits([](const std::string& text) {
              return wire::encode(SceneSignal{0, text}).has_value();
            }),
            kMaxSignalName);
}

TEST(TextLimits, AnInstructionThatCannotBeSentIsAnErrorWithFileAndLine) {
  const auto withInstruction = [](std::size_t bytes) {
    const std::string text = test::smallScenario();
    const std::size_t at = text.find("    touch: part\n");
    return text.substr(0, at) + "    instruction: {en: \"" + std::string(bytes, 'x') + "\"}\n" +
           text.substr(at);
  };
  const auto longest = game_control::parseScenario(withInstruction(kMaxInstruction), "small/scenario.yaml");
  EXPECT_TRUE(longest) << longest.error().what;
  const auto refused = game_control::parseScenario(withInstruction(224), "small/scenario.yaml");
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().what,
              AllOf(HasSubstr("small/scenario.yaml:"), HasSubstr("224 bytes"), HasSubstr("at most 223")));
}

}  // namespace
}  // namespace tenon::session
