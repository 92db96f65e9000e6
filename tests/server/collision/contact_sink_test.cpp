#include "server/collision/contact_sink.h"

#include <algorithm>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace tenon {
namespace {

constexpr double kLowest = -0.012;
constexpr double kHighest = 0.002;
constexpr std::uint32_t kEvery = 0xFFFFFFFFU;

/// Lists contacts of these gaps as a query does, some at a time.
void listAll(const std::vector<double>& gaps, std::size_t at_a_time, PairQueryResult& result) {
  ContactSink sink(result, kLowest, kHighest);
  const auto coming = std::make_unique<IncomingContacts>();
  for (std::size_t first = 0; first < gaps.size(); first += at_a_time) {
    const std::size_t end = std::min(gaps.size(), first + at_a_time);
    const bool has_room = sink.hasRoom(end - first);
    coming->count = 0;
    for (std::size_t i = first; i < end; ++i) {
      const auto point = static_cast<std::uint32_t>(i);
      coming->push_back(gaps[i], point, point);
    }
    const GapRank last = has_room ? GapRank{kHighest, kEvery} : sink.makeRoom(*coming);
    for (std::size_t i = 0; i < coming->count; ++i) {
      if (last < GapRank{coming->gap[i], coming->point[i]}) continue;
      Contact contact;
      contact.gap = coming->gap[i];
      contact.point = coming->point[i];
      ASSERT_TRUE(result.contacts.push_back(contact));
    }
  }
}

/// Names of those with the smallest gaps, in order.
std::vector<std::uint32_t> smallest(const std::vector<double>& gaps) {
  std::vector<std::uint32_t> names(gaps.size());
  for (std::uint32_t i = 0; i < names.size(); ++i) names[i] = i;
  std::stable_sort(names.begin(), names.end(),
                   [&gaps](std::uint32_t a, std::uint32_t b) { return gaps[a] < gaps[b]; });
  names.resize(std::min(names.size(), kMaxPairContacts));
  std::sort(names.begin(), names.end());
  return names;
}

TEST(ContactSink, KeepsTheSmallestGapsInTheOrderOfTheShell) {
  std::mt19937_64 engine(5);
  const auto result = std::make_unique<PairQueryResult>();
  for (int trial = 0; trial < 300; ++trial) {
    // spread over all steps, over a few, over less than one, or all equal
    const double width = std::array{1.0, 0.05, 0.001, 0.0}[static_cast<std::size_t>(trial) % 4];
    std::vector<double> gaps(engine() % 3000);
    for (double& gap : gaps) {
      const double share = static_cast<double>(engine() >> 11U) / 9007199254740992.0;
      gap = kLowest + (kHighest - kLowest) * (0.4 + 0.6 * width * share);
    }
    *result = {};
    listAll(gaps, 1 + engine() % 700, *result);
    const std::vector<std::uint32_t> wanted = smallest(gaps);
    ASSERT_EQ(result->contacts.size(), wanted.size()) << "trial " << trial;
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      ASSERT_EQ(result->contacts[i].point, wanted[i]) << "trial " << trial;
    }
    EXPECT_EQ(result->counts.contacts_dropped, gaps.size() - wanted.size());
    if (gaps.size() == wanted.size()) continue;
    double largest = kLowest;
    for (const std::uint32_t name : wanted) largest = std::max(largest, gaps[name]);
    EXPECT_EQ(result->listed_to, largest);
  }
}

}  // namespace
}  // namespace tenon
