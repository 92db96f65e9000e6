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
  };
  for (const auto& [text, reason] : cases) {
    const auto request = parseViewerText(text);
    ASSERT_FALSE(request) << text.substr(0, 80);
    EXPECT_THAT(request.error().what, HasSubstr(reason)) << text.substr(0, 80);
  }
}

}  // namespace
}  // namespace tenon::console
