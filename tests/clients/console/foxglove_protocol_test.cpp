#include "clients/console/foxglove_protocol.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace tenon::console {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

TEST(FoxgloveProtocol, TakesTheFirstKnownNameThatIsOffered) {
  EXPECT_EQ(chooseSubprotocol("foxglove.websocket.v1"), "foxglove.websocket.v1");
  EXPECT_EQ(chooseSubprotocol("foxglove.websocket.v1, foxglove.sdk.v1"), "foxglove.websocket.v1");
  EXPECT_EQ(chooseSubprotocol("other,\t foxglove.sdk.v1 "), "foxglove.sdk.v1");
  for (const char* none : {"", ",", " , ,", "foxglove.sdk.v2", "foxglove.sdk.v1x", "foxglove"})
    EXPECT_FALSE(chooseSubprotocol(none)) << none;
}

TEST(FoxgloveProtocol, AdvertisesChannels) {
  const auto json = nlohmann::json::parse(advertiseText(
      {{3, "/tf", "cdr", "foxglove::FrameTransforms", "module \"x\"", "omgidl", Delivery::kNewest}}));
  EXPECT_EQ(json,
            nlohmann::json::parse(R"({"op":"advertise","channels":[{"id":3,"topic":"/tf","encoding":"cdr",
      "schemaName":"foxglove::FrameTransforms","schema":"module \"x\"","schemaEncoding":"omgidl"}]})"));
}

TEST(FoxgloveProtocol, TextsAreJsonWhateverTheyQuote) {
  const auto json = nlohmann::json::parse(statusText(StatusLevel::kWarning, "\xFF\"\\\n"));
  EXPECT_EQ(json["op"], "status");
  EXPECT_EQ(json["level"], 1);
}

TEST(FoxgloveProtocol, UnderstandsSubscriptions) {
  const auto subscribe = parseViewerText(
      R"({"op":"subscribe","subscriptions":[{"id":0,"channelId":4},{"id":4294967295,"channelId":1}]})");
  ASSERT_TRUE(subscribe) << subscribe.error().what;
  EXPECT_THAT(subscribe->subscribe, ElementsAre(Pair(0U, 4U), Pair(4294967295U, 1U)));
  const auto unsubscribe = parseViewerText(R"({"op":"unsubscribe","subscriptionIds":[7,8]})");
  ASSERT_TRUE(unsubscribe) << unsubscribe.error().what;
  EXPECT_THAT(unsubscribe->unsubscribe, ElementsAre(7U, 8U));
}

TEST(FoxgloveProtocol, UnderstandsRequestsToTheDesk) {
  const auto sit = parseViewerText(
      R"({"op":"deskSit","id":3,"role":"instructor","name":"Ada","key":"00ff","words":["skip"]})");
  ASSERT_TRUE(sit && sit->desk) << sit.error().what;
  EXPECT_EQ(sit->desk->kind, DeskRequest::Kind::kSit);
  EXPECT_EQ(sit->desk->id, 3U);
  EXPECT_EQ(sit->desk->role, "instructor");
  EXPECT_EQ(sit->desk->name, "Ada");
  EXPECT_EQ(sit->desk->key, "00ff");
  const auto command = parseViewerText(R"({"op":"deskCommand","id":4,"words":["note","mind the edge"]})");
  ASSERT_TRUE(command && command->desk) << command.error().what;
  EXPECT_EQ(command->desk->kind, DeskRequest::Kind::kCommand);
  EXPECT_THAT(command->desk->words, ElementsAre("note", "mind the edge"));
  EXPECT_FALSE(command->desk->newest_raise);
  const auto clear = parseViewerText(R"({"op":"deskCommand","id":4,"words":["clear"],"newestRaise":2})");
  ASSERT_TRUE(clear && clear->desk) << clear.error().what;
  EXPECT_EQ(clear->desk->newest_raise, 2U);
  const auto take = parseViewerText(R"({"op":"handTake","id":5,"role":"trainee","hands":["right","left"]})");
  ASSERT_TRUE(take && take->desk) << take.error().what;
  EXPECT_EQ(take->desk->kind, DeskRequest::Kind::kTakePart);
  EXPECT_TRUE(take->desk->isOfHands());
  EXPECT_THAT(take->desk->hands, ElementsAre("right", "left"));
  EXPECT_EQ(nlohmann::json::parse(deskAnswerText({.id = 5, .is_of_hands = true})).at("op"), "handAnswer");
  const auto answer = nlohmann::json::parse(deskAnswerText({4, false, "\xFF", "instructor"}));
  EXPECT_EQ(answer["id"], 4);
  EXPECT_EQ(answer["accepted"], false);
  EXPECT_EQ(answer["role"], "instructor");
  EXPECT_TRUE(answer["commands"].empty());
  const auto seat = nlohmann::json::parse(
      deskAnswerText({.commands = {{"pause", CommandKind::kPause}, {"record", std::nullopt}}}));
  EXPECT_EQ(seat["commands"], nlohmann::json::parse(R"({"pause": 2, "record": null})"));
}

TEST(FoxgloveProtocol, SaysWhatIsWrongWithARequest) {
  const std::vector<std::pair<std::string, std::string>> cases{
      {"", "no JSON object"},
      {"[1,2]", "no JSON object"},
      {"{\"op\":", "no JSON object"},
      {std::string(60'000, '['), "no JSON object"},
      {"{}", "without 'op'"},
      {R"({"op":7})", "without 'op'"},
      {R"({"op":"publish"})", "'publish' is not offered"},
      {R"({"op":"subscribe"})", "without a list"},
      {R"({"op":"subscribe","subscriptions":{}})", "without a list"},
      {R"({"op":"subscribe","subscriptions":[3]})", "without numbers"},
      {R"({"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]})", "without numbers"},
      {R"({"op":"subscribe","subscriptions":[{"id":4294967296,"channelId":1}]})", "without numbers"},
      {R"({"op":"subscribe","subscriptions":[{"id":1.5,"channelId":1}]})", "without numbers"},
      {R"({"op":"unsubscribe","subscriptionIds":["a"]})", "no number"},
      {R"({"op":"deskCommand","words":["skip"]})", "without a number 'id'"},
      {R"({"op":"deskCommand","id":0,"words":["skip"]})", "without a number 'id'"},
      {R"({"op":"deskCommand","id":1})", "without a list 'words'"},
      {R"({"op":"deskCommand","id":1,"words":[]})", "without a list 'words'"},
      {R"({"op":"deskCommand","id":1,"words":["a","b","c","d","e","f","g","h","i"]})",
       "without a list 'words'"},
      {R"({"op":"deskCommand","id":1,"words":[7]})", "no text"},
      {R"({"op":"deskCommand","id":1,"words":["clear"],"newestRaise":-1})", "no number of a raise"},
      {R"({"op":"deskRule","id":1})", "'deskRule' is not offered"},
      {R"({"op":"handTake","id":1})", "without a list 'hands'"},
      {R"({"op":"handTake","id":1,"hands":["a","b","c"]})", "of 1 to 2 texts"},
      {R"({"op":"handTake","hands":["a"]})", "without a number 'id'"},
      {R"({"op":"handWave","id":1})", "'handWave' is not offered"},
  };
  for (const auto& [text, reason] : cases) {
    const auto request = parseViewerText(text);
    ASSERT_FALSE(request) << text.substr(0, 80);
    EXPECT_THAT(request.error().what, HasSubstr(reason)) << text.substr(0, 80);
  }
}

}  // namespace
}  // namespace tenon::console
