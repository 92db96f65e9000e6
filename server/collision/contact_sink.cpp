#include "server/collision/contact_sink.h"

#include <bit>
#include <cassert>

namespace tenon {

namespace {

/// Cosine of the angle up to which two normals push in the same direction.
constexpr double kSameDirection = 0.95;

bool sameDirection(const Vector3& a, const Vector3& b) {
  const double dot = a.dot(b);
  return dot > 0.0 && dot * dot > kSameDirection * kSameDirection * a.squaredNorm() * b.squaredNorm();
}

/// Those with the smallest gaps, at most `limit` of each direction; a bit each.
std::uint32_t nearestOfEachDirection(const LeafContacts& leaf, std::size_t limit) {
  // by gap
  std::array<double, LeafContacts::kMost> gaps;
  std::array<std::uint8_t, LeafContacts::kMost> order;
  for (std::size_t i = 0; i < leaf.count; ++i) {
    const double own = leaf.gap[i];
    std::size_t place = i;
    for (; place > 0 && own < gaps[place - 1]; --place) {
      gaps[place] = gaps[place - 1];
      order[place] = order[place - 1];
    }
    gaps[place] = own;
    order[place] = static_cast<std::uint8_t>(i);
  }
  // the nearest leads its direction, and each joins the first leader that it agrees with
  struct Direction {
    Vector3 n;
    std::size_t kept;
  };
  FixedVector<Direction, LeafContacts::kMost> directions;
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

ContactSink::ContactSink(PairQueryResult& result, double lowest, double highest)
    : result_(result), lowest_(lowest), steps_a_metre_(static_cast<double>(kSteps) / (highest - lowest)) {}

std::uint32_t ContactSink::thinned(const LeafContacts& leaf) {
  const std::uint32_t all = (1U << leaf.count) - 1U;
  std::uint32_t chosen = all;
  while (true) {
    if (per_leaf_ < leaf.count) chosen = nearestOfEachDirection(leaf, per_leaf_);
    const auto count = static_cast<std::size_t>(std::popcount(chosen));
    const bool fits = result_.contacts.size() + count <= kThinnedTo;
    if (fits || per_leaf_ == 1 || result_.counts.contacts_dropped > 0) break;
    per_leaf_ /= 2;
    thinList();
  }
  result_.thinned = result_.thinned || chosen != all;
  if (leaf_count_ < leaf_starts_.size()) {
    leaf_starts_[leaf_count_++] = static_cast<std::uint32_t>(result_.contacts.size());
  }
  return chosen;
}

void ContactSink::thinList() {
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
    const std::uint32_t chosen = nearestOfEachDirection(all, per_leaf_);
    for (std::size_t i = 0; i < all.count; ++i) {
      if ((chosen >> i & 1U) != 0) contacts[kept++] = contacts[first + i];
    }
  }
  contacts.resize(kept);
  result_.thinned = result_.thinned || kept < size;
}

GapRank ContactSink::makeRoom(const IncomingContacts& coming) {
  ContactList& contacts = result_.contacts;
  const std::size_t listed = contacts.size();
  const std::size_t count = listed + coming.count;
  assert(count > kMaxPairContacts);
  const auto rankOf = [&](std::size_t i) {
    return i < listed ? GapRank{contacts[i].gap, contacts[i].point}
                      : GapRank{coming.gap[i - listed], coming.point[i - listed]};
  };
  // counted in equal steps of gaps
  std::array<std::uint16_t, kMaxPairContacts + IncomingContacts::kMost> step;
  for (std::size_t i = 0; i < listed; ++i) step[i] = stepOf(contacts[i].gap);
  for (std::size_t i = 0; i < coming.count; ++i) step[listed + i] = stepOf(coming.gap[i]);
  std::array<std::uint32_t, kSteps> counts{};
  for (std::size_t i = 0; i < count; ++i) ++counts[step[i]];
  // the last step for which there is room, and who is in it
  std::size_t last_step = kSteps - 1;
  std::size_t up_to_it = count;
  while (up_to_it - counts[last_step] >= kMaxPairContacts) up_to_it -= counts[last_step--];
  const std::size_t places = kMaxPairContacts - (up_to_it - counts[last_step]);
  std::array<std::uint16_t, step.size()> in_it{};
  auto end = in_it.begin();
  for (std::size_t i = 0; i < count; ++i) {
    if (step[i] == last_step) *end++ = static_cast<std::uint16_t>(i);
  }
  const auto place = in_it.begin() + static_cast<std::ptrdiff_t>(places - 1);
  std::nth_element(in_it.begin(), place, end,
                   [&](std::size_t a, std::size_t b) { return rankOf(a) < rankOf(b); });
  const GapRank last = rankOf(*place);

  std::size_t kept = 0;
  for (std::size_t i = 0; i < listed; ++i) {
    if (last < rankOf(i)) continue;
    if (kept != i) contacts[kept] = contacts[i];
    ++kept;
  }
  contacts.resize(kept);
  result_.counts.contacts_dropped += static_cast<std::uint32_t>(count - kMaxPairContacts);
  result_.listed_to = last.gap;
  return last;
}

}  // namespace tenon
