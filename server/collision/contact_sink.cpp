#include "server/collision/contact_sink.h"

#include <bit>

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

/// How contacts are ranked: by gap, then by name.
struct GapRank {
  double gap;
  std::uint32_t point;

  bool operator<(const GapRank& other) const {
    return gap != other.gap ? gap < other.gap : point < other.point;
  }
};

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

bool ContactSink::overflows(std::size_t count) {
  if (overflow_) return true;
  if (result_.contacts.size() + count <= kMaxPairContacts) return false;
  overflow_.emplace();
  histogram_.fill(0);
  for (const Contact& listed : result_.contacts) announce(listed.gap);
  closeAnnouncement();
  return true;
}

void ContactSink::selectDeepest() {
  if (!overflow_ || overflow_->empty()) return;
  // those of the last step have the places that are left
  ContactList& contacts = result_.contacts;
  std::array<GapRank, kMaxPairContacts + decltype(overflow_)::value_type::capacity()> last;
  std::size_t of_last = 0;
  std::size_t before = 0;
  const auto rank = [&](const Contact& contact) {
    const double step = inSteps(contact.gap);
    if (step < last_begin_) ++before;
    if (step >= last_begin_ && step < last_end_) last[of_last++] = {contact.gap, contact.point};
  };
  std::for_each(contacts.begin(), contacts.end(), rank);
  std::for_each(overflow_->begin(), overflow_->end(), rank);
  const std::size_t listed = contacts.size() + overflow_->size();
  // of the steps before there are never too many
  const std::size_t places = std::min(kMaxPairContacts - before, of_last);
  const auto end = last.begin() + static_cast<std::ptrdiff_t>(of_last);
  const auto beyond = last.begin() + static_cast<std::ptrdiff_t>(places);
  if (beyond != end) std::nth_element(last.begin(), beyond, end);
  std::size_t kept = 0;
  const auto keep = [&](const Contact& contact) {
    const double step = inSteps(contact.gap);
    if (step >= last_end_) return;
    if (step >= last_begin_ && beyond != end && !(GapRank{contact.gap, contact.point} < *beyond)) return;
    Contact& place = contacts[kept++];
    if (&place != &contact) place = contact;
  };
  std::for_each(contacts.begin(), contacts.end(), keep);
  contacts.resize(kMaxPairContacts);
  std::for_each(overflow_->begin(), overflow_->end(), keep);
  contacts.resize(kept);
  result_.counts.contacts_dropped += static_cast<std::uint32_t>(listed - kept);
  overflow_->clear();
}

}  // namespace tenon
