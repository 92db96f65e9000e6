#include "server/collision/contact_reducer.h"

#include <algorithm>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace tenon::collision {
namespace {

constexpr double kLowest = -0.012;  // [m]
constexpr double kHighest = 0.002;  // [m]

/// The points of these gaps that stay, when they come in batches as in a query.
std::unique_ptr<NearPoints> reduced(const std::vector<double>& gaps, std::size_t at_a_time,
                                    PairQueryResult& result) {
  ContactReducer reducer(result, kLowest, kHighest);
  auto near = std::make_unique<NearPoints>();
  for (std::size_t first = 0; first < gaps.size(); first += at_a_time) {
    const std::size_t end = std::min(gaps.size(), first + at_a_time);
    if (!near->fits(end - first)) reducer.keepSmallestGaps(*near);
    for (std::size_t i = first; i < end; ++i) {
      near->gap[near->count] = gaps[i];
      near->point[near->count++] = static_cast<std::uint32_t>(i);
    }
  }
  reducer.keepSmallestGaps(*near);
  return near;
}

/// Indices of the points with the smallest gaps, in ascending order.
std::vector<std::uint32_t> smallest(const std::vector<double>& gaps) {
  std::vector<std::uint32_t> points(gaps.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) points[i] = i;
  std::stable_sort(points.begin(), points.end(),
                   [&gaps](std::uint32_t a, std::uint32_t b) { return gaps[a] < gaps[b]; });
  points.resize(std::min(points.size(), kMaxPairContacts));
  std::sort(points.begin(), points.end());
  return points;
}

TEST(ContactReducer, KeepsTheSmallestGapsInPointshellOrder) {
  std::mt19937_64 engine(5);
  const auto result = std::make_unique<PairQueryResult>();
  for (int trial = 0; trial < 300; ++trial) {
    // gaps in all bins, in a few, in less than one, or all equal
    const double width = std::array{1.0, 0.05, 0.001, 0.0}[static_cast<std::size_t>(trial) % 4];
    std::vector<double> gaps(engine() % 9000);
    for (double& gap : gaps) {
      const double fraction = static_cast<double>(engine() >> 11U) / 9007199254740992.0;
      gap = kLowest + (kHighest - kLowest) * (0.4 + 0.6 * width * fraction);
    }
    *result = {};
    const auto near = reduced(gaps, 1 + engine() % 700, *result);
    const std::vector<std::uint32_t> expected = smallest(gaps);
    ASSERT_EQ(near->count, expected.size()) << "trial " << trial;
    for (std::size_t i = 0; i < expected.size(); ++i) {
      ASSERT_EQ(near->point[i], expected[i]) << "trial " << trial;
    }
    EXPECT_EQ(result->counts.contacts_dropped, gaps.size() - expected.size());
    if (gaps.size() == expected.size()) continue;
    double largest = kLowest;
    for (const std::uint32_t point : expected) largest = std::max(largest, gaps[point]);
    EXPECT_EQ(result->complete_to, largest);
  }
}

}  // namespace
}  // namespace tenon::collision
