#include "server/collision/contact_reducer.h"

#include <array>
#include <bit>
#include <cassert>

namespace tenon::collision {

namespace {

constexpr std::size_t kLeaf = structures::Pointshell::kLeafPoints;

/// [-] Cosine of the largest angle between two normals of the same direction.
constexpr double kSameDirection = 0.95;

bool sameDirection(const Vector3& a, const Vector3& b) {
  const double dot = a.dot(b);
  return dot > 0.0 && dot * dot > kSameDirection * kSameDirection * a.squaredNorm() * b.squaredNorm();
}

/// Bit mask of the points of a leaf, from number `first` on, with the smallest gaps: at most `limit` of each
/// normal direction; `directionOf` a point, of any length.
template <typename DirectionOf>
std::uint32_t smallestGapsPerDirection(const NearPoints& near, std::size_t first, std::size_t count,
                                       std::size_t limit, DirectionOf&& directionOf) {
  // insertion sort by gap
  std::array<double, kLeaf> gaps;
  std::array<std::uint8_t, kLeaf> order;
  for (std::size_t i = 0; i < count; ++i) {
    const double own = near.gap[first + i];
    std::size_t position = i;
    for (; position > 0 && own < gaps[position - 1]; --position) {
      gaps[position] = gaps[position - 1];
      order[position] = order[position - 1];
    }
    gaps[position] = own;
    order[position] = static_cast<std::uint8_t>(i);
  }
  // each point joins the first direction that it agrees with, else it starts a new one
  struct Direction {
    Vector3 n;
    std::size_t kept;
  };
  std::array<Direction, kLeaf> directions;
  std::size_t direction_count = 0;
  std::uint32_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3 n = directionOf(first + order[i]);
    std::size_t k = 0;
    while (k < direction_count && !sameDirection(directions[k].n, n)) ++k;
    if (k == direction_count) directions[direction_count++] = {n, 0};
    if (directions[k].kept++ < limit) kept |= 1U << order[i];
  }
  return kept;
}

/// Moves the chosen ones of the points from number `from` on to `to`; returns the number of the next.
std::size_t moveChosen(NearPoints& near, std::uint32_t chosen, std::size_t from, std::size_t to) {
  for (; chosen != 0; chosen &= chosen - 1) {
    const std::size_t i = from + static_cast<std::size_t>(std::countr_zero(chosen));
    if (i != to) near.move(i, to);
    ++to;
  }
  return to;
}

}  // namespace

ContactReducer::ContactReducer(PairQueryResult& result, double lowest, double highest)
    : result_(result), lowest_(lowest), bins_per_metre_(static_cast<double>(kBins) / (highest - lowest)) {}

void ContactReducer::reduceLeaves(const LaneFrame& frame, const structures::Pointshell& shell,
                                  std::size_t first, NearPoints& near) {
  std::size_t kept = first;
  for (std::size_t from = first, end = first; from < near.count; from = end) {
    const structures::ShellSphere& leaf = shell.leaves()[shell.leafOf(near.point[from])];
    while (end < near.count && near.point[end] - leaf.first < leaf.count) ++end;
    const std::size_t count = end - from;
    const std::uint32_t all = (1U << count) - 1U;
    std::uint32_t chosen = all;
    while (true) {
      if (per_leaf_ < count)
        chosen = smallestGapsPerDirection(near, from, count, per_leaf_,
                                          [&near](std::size_t i) { return near.gradient(i); });
      const auto wanted = static_cast<std::size_t>(std::popcount(chosen));
      if (kept + wanted <= kReducedSize || per_leaf_ == 1) break;
      per_leaf_ /= 2;
      kept = reduceEarlier(frame, shell, near, kept);
    }
    result_.reduced = result_.reduced || chosen != all;
    if (per_leaf_ > 1) leaf_starts_.push_back(static_cast<std::uint32_t>(kept));
    kept = moveChosen(near, chosen, from, kept);
  }
  near.count = kept;
}

std::size_t ContactReducer::reduceEarlier(const LaneFrame& frame, const structures::Pointshell& shell,
                                          NearPoints& near, std::size_t kept) {
  // as in the list: without a usable gradient the inward normal of A's surface
  const auto normal_B = [&](std::size_t i) -> Vector3 {
    const Vector3 gradient = near.gradient(i);
    if (gradient.norm() >= kMinGradient) return gradient;
    return frame.R_BA * shell.points()[near.point[i]].inward_M.cast<double>();
  };
  std::size_t now = 0;
  for (std::size_t leaf = 0; leaf < leaf_starts_.size(); ++leaf) {
    const std::size_t from = leaf_starts_[leaf];
    const std::size_t end = leaf + 1 < leaf_starts_.size() ? leaf_starts_[leaf + 1] : kept;
    leaf_starts_[leaf] = static_cast<std::uint32_t>(now);
    now = moveChosen(near, smallestGapsPerDirection(near, from, end - from, per_leaf_, normal_B), from, now);
  }
  result_.reduced = result_.reduced || now < kept;
  return now;
}

GapRank ContactReducer::lastRank(const NearPoints& near) const {
  // histogram of the gaps
  std::array<std::uint16_t, NearPoints::kCapacity> bin;
  for (std::size_t i = 0; i < near.count; ++i) bin[i] = binOf(near.gap[i]);
  std::array<std::uint32_t, kBins> counts{};
  for (std::size_t i = 0; i < near.count; ++i) ++counts[bin[i]];
  // the last bin of which points stay, and its points
  std::size_t last_bin = kBins - 1;
  std::size_t count_to_bin = near.count;
  while (count_to_bin - counts[last_bin] >= kMaxPairContacts) count_to_bin -= counts[last_bin--];
  const std::size_t remaining = kMaxPairContacts - (count_to_bin - counts[last_bin]);
  std::array<std::uint16_t, NearPoints::kCapacity> in_bin{};
  auto end = in_bin.begin();
  for (std::size_t i = 0; i < near.count; ++i) {
    if (bin[i] == last_bin) *end++ = static_cast<std::uint16_t>(i);
  }
  const auto rankOf = [&near](std::size_t i) { return GapRank{near.gap[i], near.point[i]}; };
  const auto nth = in_bin.begin() + static_cast<std::ptrdiff_t>(remaining - 1);
  std::nth_element(in_bin.begin(), nth, end,
                   [&](std::size_t a, std::size_t b) { return rankOf(a) < rankOf(b); });
  return rankOf(*nth);
}

void ContactReducer::keepSmallestGaps(NearPoints& near) {
  if (near.count <= kMaxPairContacts) return;
  const GapRank last = lastRank(near);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < near.count; ++i) {
    if (last < GapRank{near.gap[i], near.point[i]}) continue;
    if (kept != i) near.move(i, kept);
    ++kept;
  }
  assert(kept == kMaxPairContacts);
  result_.counts.contacts_dropped += static_cast<std::uint32_t>(near.count - kept);
  result_.complete_to = last.gap;
  near.count = kept;
}

}  // namespace tenon::collision
