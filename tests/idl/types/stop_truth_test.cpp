#include "idl/types/stop_truth.h"

#include <algorithm>
#include <set>
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

std::set<RaiseId> standing(const StopTruth& truth) {
  std::set<RaiseId> ids;
  for (const auto& [id, stop] : truth.standing()) ids.insert(id);
  return ids;
}

TEST(StopTruth, ARaiseStandsUntilAClearNamesIt) {
  StopTruth truth;
  EXPECT_FALSE(truth.engaged());
  EXPECT_TRUE(truth.raise({"a", 1, "Ada", "hand caught"}));
  EXPECT_FALSE(truth.raise({"a", 1, "Ada", "hand caught"})) << "repeated";
  EXPECT_TRUE(truth.clear({"a", 2, "Ben", ""})) << "of a raise that was not heard yet";
  EXPECT_TRUE(truth.engaged());
  EXPECT_TRUE(truth.clear({"a", 1, "Ben", ""}));
  EXPECT_FALSE(truth.engaged());
  EXPECT_FALSE(truth.raise({"a", 2, "Ada", "late"})) << "cleared before it came";
  EXPECT_FALSE(truth.engaged());
  EXPECT_EQ(truth.raised(), 1U);
}

// Ground truth: the raises that were sent less those that a clear names, as sets. All messages of a subset,
// in every order, with one of them repeated at the end.
TEST(StopTruth, InEveryOrderOfArrivalTheSameRaisesStand) {
  const std::vector<Message> all{{false, "a", 1}, {false, "a", 2}, {false, "b", 1},
                                 {true, "a", 1},  {true, "b", 1},  {true, "c", 1}};
  int orders = 0;
  for (unsigned subset = 1; subset < 1U << all.size(); ++subset) {
    std::vector<Message> messages;
    std::set<RaiseId> expected;
    for (std::size_t i = 0; i < all.size(); ++i)
      if ((subset >> i & 1U) != 0) messages.push_back(all[i]);
    for (const Message& message : messages)
      if (!message.is_clear) expected.insert({message.guid, message.counter});
    for (const Message& message : messages)
      if (message.is_clear) expected.erase({message.guid, message.counter});
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

TEST(StopTruth, OfAClientThatRaisesWithoutEndABoundedNumberStandsUntilThoseAreCleared) {
  StopTruth truth;
  constexpr std::uint32_t kRaises = 1000;
  for (std::uint32_t counter = 1; counter <= kRaises; ++counter) {
    const StopChange change = truth.raise({"a", counter, "Ada", "hand caught"});
    ASSERT_TRUE(change);
    ASSERT_EQ(truth.raised(), counter) << "who clears has to know of it";
    ASSERT_EQ(change.superfluous.has_value(), counter > StopTruth::kMostOfClient);
    if (change.superfluous) {
      ASSERT_EQ(change.superfluous->counter, counter);
    }
    ASSERT_LE(truth.standing().size(), StopTruth::kMostOfClient);
    ASSERT_LE(truth.cleared().size(), StopTruth::kMostOfClient);
  }
  EXPECT_FALSE(truth.raise({"a", kRaises, "Ada", "late"})) << "repeated";
  EXPECT_TRUE(truth.raise({"a", kRaises / 2, "Ada", "late"}).superfluous)
      << "forgotten, beside those that stand";
  truth.raise({"b", 1, "Ben", "another client"});
  EXPECT_EQ(truth.standing().size(), StopTruth::kMostOfClient + 1);
  const auto standing = truth.standing();
  for (const auto& [id, stop] : standing) {
    EXPECT_TRUE(truth.engaged());
    truth.clear({id.client_guid, id.counter, "Ben", "safe"});
  }
  EXPECT_FALSE(truth.engaged());
  EXPECT_TRUE(truth.raise({"a", kRaises + 1, "Ada", "hand caught"}));
  EXPECT_TRUE(truth.engaged());
}

TEST(StopTruth, OfRaisesUnderEverNewNamesABoundedNumberStands) {
  StopTruth truth;
  for (std::uint32_t client = 0; client < 3 * StopTruth::kMostInAll; ++client) {
    const std::string guid = std::to_string(client);
    ASSERT_TRUE(truth.raise({guid, 1, "Ada", "hand caught"}));
    ASSERT_EQ(truth.standing().contains({guid, 1}), client < StopTruth::kMostInAll);
  }
  EXPECT_EQ(truth.standing().size(), StopTruth::kMostInAll);
  EXPECT_EQ(truth.cleared().size(), StopTruth::kMostInAll);
}

}  // namespace
}  // namespace tenon
