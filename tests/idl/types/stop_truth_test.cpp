#include "idl/types/stop_truth.h"

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace tenon {
namespace {

/// A message about raise `counter` of client `guid`.
struct Message {
  bool is_clear = false;
  std::string guid;
  std::uint32_t counter = 0;
  auto operator<=>(const Message&) const = default;
};

void hear(StopTruth& truth, const Message& message) {
  if (message.is_clear) {
    truth.clear({message.guid, message.counter, "Ben", "safe"});
  } else {
    truth.raise({message.guid, message.counter, "Ada", "hand caught"});
  }
}

/// By client, the number of the raise that stands.
using Standing = std::map<std::string, std::uint32_t>;

Standing standing(const StopTruth& truth) {
  Standing found;
  for (const auto& [client, stop] : truth.standing()) found[client] = stop.counter;
  return found;
}

TEST(StopTruth, ARaiseStandsUntilAClearNamesIt) {
  StopTruth truth;
  EXPECT_FALSE(truth.engaged());
  EXPECT_TRUE(truth.raise({"a", 1, "Ada", "hand caught"}));
  EXPECT_FALSE(truth.raise({"a", 1, "Ada", "hand caught"})) << "repeated";
  EXPECT_TRUE(truth.clear({"b", 2, "Ben", ""})) << "of a raise that was not heard yet";
  EXPECT_TRUE(truth.engaged());
  EXPECT_TRUE(truth.clear({"a", 1, "Ben", ""}));
  EXPECT_FALSE(truth.clear({"a", 1, "Ben", ""})) << "repeated";
  EXPECT_FALSE(truth.engaged());
  EXPECT_FALSE(truth.raise({"b", 2, "Ada", "late"})) << "cleared before it came";
  EXPECT_FALSE(truth.raise({"b", 1, "Ada", "later"})) << "raised before that one";
  EXPECT_FALSE(truth.engaged());
  EXPECT_EQ(truth.raised(), 1U);
}

// Ground truth: of each client the newest raise that was sent, unless a clear names it or a later one. All
// messages of a subset, in every order, with one of them repeated at the end.
TEST(StopTruth, InEveryOrderOfArrivalTheSameRaisesStand) {
  const std::vector<Message> all{{false, "a", 1}, {false, "a", 2}, {false, "b", 1},
                                 {true, "a", 1},  {true, "b", 2},  {true, "c", 1}};
  int orders = 0;
  for (unsigned subset = 1; subset < 1U << all.size(); ++subset) {
    std::vector<Message> messages;
    Standing expected;
    for (std::size_t i = 0; i < all.size(); ++i)
      if ((subset >> i & 1U) != 0) messages.push_back(all[i]);
    for (const Message& message : messages)
      if (!message.is_clear) expected[message.guid] = std::max(expected[message.guid], message.counter);
    for (const Message& message : messages)
      if (message.is_clear && expected.contains(message.guid) && expected[message.guid] <= message.counter)
        expected.erase(message.guid);
    std::sort(messages.begin(), messages.end());
    do {
      StopTruth truth;
      for (const Message& message : messages) hear(truth, message);
      hear(truth, messages.front());
      ASSERT_EQ(standing(truth), expected) << "subset " << subset;
      ASSERT_EQ(truth.engaged(), !expected.empty());
      ++orders;
    } while (std::next_permutation(messages.begin(), messages.end()));
  }
  EXPECT_EQ(orders, 1956) << "sum over k of 6! / (6 - k)!, less the empty one";
}

TEST(StopTruth, OfAClientThatRaisesWithoutEndTheNewestRaiseStandsForAllUntilItIsCleared) {
  StopTruth truth;
  constexpr std::uint32_t kRaises = 1000;
  for (std::uint32_t counter = 1; counter <= kRaises; ++counter) {
    const StopChange change = truth.raise({"a", counter, "Ada", "hand caught"});
    ASSERT_TRUE(change);
    ASSERT_EQ(truth.raised(), counter) << "who clears has to know of it";
    ASSERT_EQ(change.ended.has_value(), counter > 1) << "the one before is not told any more";
    ASSERT_EQ(standing(truth), (Standing{{"a", counter}}));
  }
  EXPECT_FALSE(truth.raise({"a", kRaises / 2, "Ada", "late"})) << "repeated";
  truth.raise({"b", 1, "Ben", "another client"});
  const StopChange cleared = truth.clear({"a", kRaises, "Ben", "safe"});
  ASSERT_TRUE(cleared.ended);
  EXPECT_EQ(cleared.ended->counter, kRaises);
  EXPECT_EQ(standing(truth), (Standing{{"b", 1}}));
  EXPECT_TRUE(truth.raise({"a", kRaises + 1, "Ada", "hand caught"}));
  EXPECT_EQ(standing(truth), (Standing{{"a", kRaises + 1}, {"b", 1}}));
}

// who joins late hears the clears that the server still has, and the raises of a client that repeats all
TEST(StopTruth, HoweverManyRaisesOfAClientWereClearedTheyStaySoForWhoComesLater) {
  StopTruth server;
  constexpr std::uint32_t kRaises = 200;
  for (std::uint32_t counter = 1; counter <= kRaises; ++counter) {
    server.raise({"a", counter, "Ada", "hand caught"});
    if (counter % 70 != 0 && counter != kRaises) continue;
    const auto standing = server.standing();
    for (const auto& [client, stop] : standing) server.clear({client, stop.counter, "Ben", "safe"});
  }
  EXPECT_EQ(server.cleared().size(), 1U);
  StopTruth late;
  for (const auto& [client, cleared] : server.cleared()) late.clear(cleared);
  for (std::uint32_t counter = 1; counter <= kRaises; ++counter) {
    EXPECT_FALSE(late.raise({"a", counter, "Ada", "hand caught"}));
    EXPECT_FALSE(server.raise({"a", counter, "Ada", "hand caught"}));
  }
  EXPECT_FALSE(late.engaged());
  EXPECT_TRUE(late.raise({"a", kRaises + 1, "Ada", "hand caught"})) << "a new one";
}

TEST(StopTruth, OfRaisesUnderEverNewNamesABoundedNumberStands) {
  StopTruth truth;
  for (std::uint32_t client = 0; client < 3 * StopTruth::kMostClients; ++client) {
    const std::string guid = std::to_string(client);
    ASSERT_TRUE(truth.raise({guid, 1, "Ada", "hand caught"}));
    ASSERT_EQ(truth.standing().contains(guid), client < StopTruth::kMostClients);
  }
  EXPECT_EQ(truth.standing().size(), StopTruth::kMostClients);
  EXPECT_EQ(truth.cleared().size(), StopTruth::kMostClients);
}

}  // namespace
}  // namespace tenon
