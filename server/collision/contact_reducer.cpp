#include "server/collision/contact_reducer.h"

#include <bit>
#include <cassert>

namespace tenon::collision {

namespace {

/// [-] Cosine of the largest angle between two normals of the same direction.
constexpr double kSameDirection = 0.95;

bool sameDirection(const Vector3& a, const Vector3& b) {
  const double dot = a.dot(b);
  return dot > 0.0 && dot * dot > kSameDirection * kSameDirection * a.squaredNorm() * b.squaredNorm();
}

/// Bit mask of the contacts with the smallest gaps, at most `limit` of each normal direction.
std::uint32_t smallestGapsPerDirection(const LeafContacts& leaf, std::size_t limit) {
  // insertion sort by gap
  std::array<double, LeafContacts::kCapacity> gaps;
  std::array<std::uint8_t, LeafContacts::kCapacity> order;
  for (std::size_t i = 0; i < leaf.count; ++i) {
    const double own = leaf.gap[i];
    std::size_t position = i;
    for (; position > 0 && own < gaps[position - 1]; --position) {
      gaps[position] = gaps[position - 1];
      order[position] = order[position - 1];
    }
    gaps[position] = own;
    order[position] = static_cast<std::uint8_t>(i);
  }
  // each contact joins the first direction that it agrees with, else it starts a new one
  struct Direction {
    Vector3 n;
    std::size_t kept;
  };
  FixedVector<Direction, LeafContacts::kCapacity> directions;
  std::uint32_t kept = 0;
  for (std::size_t i = 0; i < leaf.count; ++i) {
    const Vector3& n = leaf.direction[order[i]];
    Direction* direction = std::find_if(directions.begin(), directions.end(),
                                        [&n](const Direction& each) { return sameDirection(each.n, n); });
    if (direction == directions.end()) {
      directions.push_back({n, 0});
      direction = &directions.back();
    }
    if (direction->kept++ < limit) kept |= 1U << order[i];
  }
  return kept;
}

}  // namespace

ContactReducer::ContactReducer(PairQueryResult& result, double lowest, double highest)
    : result_(result), lowest_(lowest), bins_per_metre_(static_cast<double>(kBins) / (highest - lowest)) {}

std::uint32_t ContactReducer::reduceLeaf(const LeafContacts& leaf) {
  const std::uint32_t all = (1U << leaf.count) - 1U;
  std::uint32_t chosen = all;
  while (true) {
    if (per_leaf_ < leaf.count) chosen = smallestGapsPerDirection(leaf, per_leaf_);
    const auto count = static_cast<std::size_t>(std::popcount(chosen));
    const bool fits = result_.contacts.size() + count <= kReducedSize;
    if (fits || per_leaf_ == 1 || result_.counts.contacts_dropped > 0) break;
    per_leaf_ /= 2;
    reduceList();
  }
  result_.reduced = result_.reduced || chosen != all;
  if (leaf_count_ < leaf_starts_.size()) {
    leaf_starts_[leaf_count_++] = static_cast<std::uint32_t>(result_.contacts.size());
  }
  return chosen;
}

void ContactReducer::reduceList() {
  ContactList& contacts = result_.contacts;
  const std::size_t size = contacts.size();
  std::size_t kept = 0;
  for (std::size_t leaf = 0; leaf < leaf_count_; ++leaf) {
    const std::size_t first = leaf_starts_[leaf];
    const std::size_t end = leaf + 1 < leaf_count_ ? leaf_starts_[leaf + 1] : size;
    LeafContacts all;
    all.count = end - first;
    for (std::size_t i = 0; i < all.count; ++i) {
      all.gap[i] = contacts[first + i].gap;
      all.direction[i] = contacts[first + i].n_W;
    }
    leaf_starts_[leaf] = static_cast<std::uint32_t>(kept);
    const std::uint32_t chosen = smallestGapsPerDirection(all, per_leaf_);
    for (std::size_t i = 0; i < all.count; ++i) {
      if ((chosen >> i & 1U) != 0) contacts[kept++] = contacts[first + i];
    }
  }
  contacts.resize(kept);
  result_.reduced = result_.reduced || kept < size;
}

GapRank ContactReducer::evictFor(const IncomingContacts& batch) {
  ContactList& contacts = result_.contacts;
  const std::size_t listed = contacts.size();
  const std::size_t count = listed + batch.count;
  assert(count > kMaxPairContacts);
  const auto rankOf = [&](std::size_t i) {
    return i < listed ? GapRank{contacts[i].gap, contacts[i].point}
                      : GapRank{batch.gap[i - listed], batch.point[i - listed]};
  };
  // histogram of the gaps
  std::array<std::uint16_t, kMaxPairContacts + IncomingContacts::kCapacity> bin;
  for (std::size_t i = 0; i < listed; ++i) bin[i] = binOf(contacts[i].gap);
  for (std::size_t i = 0; i < batch.count; ++i) bin[listed + i] = binOf(batch.gap[i]);
  std::array<std::uint32_t, kBins> counts{};
  for (std::size_t i = 0; i < count; ++i) ++counts[bin[i]];
  // the last bin of which contacts stay, and its contacts
  std::size_t last_bin = kBins - 1;
  std::size_t count_to_bin = count;
  while (count_to_bin - counts[last_bin] >= kMaxPairContacts) count_to_bin -= counts[last_bin--];
  const std::size_t remaining = kMaxPairContacts - (count_to_bin - counts[last_bin]);
  std::array<std::uint16_t, bin.size()> in_bin{};
  auto end = in_bin.begin();
  for (std::size_t i = 0; i < count; ++i) {
    if (bin[i] == last_bin) *end++ = static_cast<std::uint16_t>(i);
  }
  const auto nth = in_bin.begin() + static_cast<std::ptrdiff_t>(remaining - 1);
  std::nth_element(in_bin.begin(), nth, end,
                   [&](std::size_t a, std::size_t b) { return rankOf(a) < rankOf(b); });
  const GapRank last = rankOf(*nth);

  std::size_t kept = 0;
  for (std::size_t i = 0; i < listed; ++i) {
    if (last < rankOf(i)) continue;
    if (kept != i) contacts[kept] = contacts[i];
    ++kept;
  }
  contacts.resize(kept);
  result_.counts.contacts_dropped += static_cast<std::uint32_t>(count - kMaxPairContacts);
  result_.complete_to = last.gap;
  return last;
}

}  // namespace tenon::collision
