#include "server/collision/feature_lists.h"

#include <algorithm>
#include <array>
#include <utility>

namespace tenon::collision {

void include(const Contact& crossing, PairQueryResult& result) noexcept {
  if (crossing.dormant()) {
    result.dormant_gap = std::min(result.dormant_gap, crossing.gapBound());
    return;
  }
  result.smallest_gap = std::min(result.smallest_gap, crossing.gap);
  result.deepest = std::max(result.deepest, -crossing.gap);
}

void drop(const Contact& contact, double margin, PairQueryResult& result) noexcept {
  const double gap = std::min(contact.gapBound(), margin);
  result.counts.contacts_dropped += contact.dormant() ? 0U : 1U;
  result.complete_to = std::min(result.complete_to, gap);
  result.unlisted_gap = std::min(result.unlisted_gap, gap);
}

void keepWithin(double margin, ContactList& contacts, PairQueryResult& result) noexcept {
  std::size_t kept = 0;
  for (const Contact& contact : contacts) {
    if (contact.gap <= margin) {
      contacts[kept++] = contact;
    } else {
      result.unlisted_gap = std::min(result.unlisted_gap, contact.gap);
    }
  }
  contacts.resize(kept);
}

void keepNearest(std::size_t most, double margin, ContactList& contacts, PairQueryResult& result) noexcept {
  if (contacts.size() <= most) return;
  std::array<std::pair<double, std::uint32_t>, ContactList::capacity()> rank;
  for (std::uint32_t i = 0; i < contacts.size(); ++i) rank[i] = {contacts[i].gap, i};
  const auto end = rank.begin() + static_cast<std::ptrdiff_t>(contacts.size());
  const auto last = rank.begin() + static_cast<std::ptrdiff_t>(most);
  std::nth_element(rank.begin(), last, end);
  const auto limit = *last;
  std::size_t kept = 0;
  for (std::uint32_t i = 0; i < contacts.size(); ++i) {
    if (std::pair(contacts[i].gap, i) < limit) {
      contacts[kept++] = contacts[i];
    } else {
      drop(contacts[i], margin, result);
    }
  }
  contacts.resize(kept);
}

}  // namespace tenon::collision
