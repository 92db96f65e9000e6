#include "clients/console/lobby.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace tenon::console {
namespace {

TEST(Lobby, ListsTheSessionsThatAreThere) {
  Lobby lobby;
  auto listed = [&lobby] {
    const auto published = lobby.take(1);
    return published.empty() ? nlohmann::json() : nlohmann::json::parse(*published[0].payload)["sessions"];
  };
  EXPECT_EQ(listed(), nlohmann::json::array()) << "at first that there is none";
  EXPECT_TRUE(listed().is_null()) << "nothing has changed";
  lobby.add({.session = "b", .server_epoch = 1, .title = "Peg and box", .host = "lab"});
  lobby.add({.session = "a", .server_epoch = 1});
  const auto two = listed();
  ASSERT_EQ(two.size(), 2U);
  EXPECT_EQ(two[1]["title"], "Peg and box");
  EXPECT_EQ(two[1]["host"], "lab");
  EXPECT_THAT(lobby.names(), testing::ElementsAre("a", "b"));
  lobby.add({.session = "a", .server_epoch = 2});
  EXPECT_THAT(lobby.names(), testing::ElementsAre("a", "b")) << "a server that started again";
  lobby.remove({.session = "a", .server_epoch = 1});
  EXPECT_THAT(lobby.names(), testing::ElementsAre("a", "b")) << "it is the one before that is gone";
  lobby.remove({.session = "a", .server_epoch = 2});
  EXPECT_EQ(listed().size(), 1U);
}

TEST(Lobby, ListsSoManySessionsAtMostAndSaysThatThereAreMore) {
  Lobby lobby;
  const auto told = [&lobby] { return nlohmann::json::parse(*lobby.take(1)[0].payload); };
  for (std::uint32_t epoch = 0; epoch < Lobby::kMaxSessions; ++epoch)
    lobby.add({.session = "a", .server_epoch = epoch});
  EXPECT_EQ(told()["more"], false);
  lobby.add({.session = "one more", .server_epoch = 1});
  const auto full = told();
  EXPECT_EQ(full["more"], true);
  EXPECT_EQ(full["sessions"].size(), Lobby::kMaxSessions);
}

TEST(Lobby, SaysWhichSessionsAreNotShown) {
  Lobby lobby;
  lobby.add({.session = "a", .server_epoch = 1});
  EXPECT_THAT(lobby.setUnserved({"a"}), testing::ElementsAre("a"));
  EXPECT_THAT(lobby.setUnserved({"a"}), testing::IsEmpty()) << "it is said once";
  EXPECT_EQ(nlohmann::json::parse(*lobby.take(1)[0].payload)["sessions"][0]["served"], false);
  lobby.setUnserved({});
  EXPECT_EQ(nlohmann::json::parse(*lobby.take(2)[0].payload)["sessions"][0]["served"], true);
}

}  // namespace
}  // namespace tenon::console
