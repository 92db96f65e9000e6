#pragma once

#include <cstddef>

#include "server/collision/pair_query.h"

namespace tenon::collision {

// What becomes of the contacts of features that a list has, or has no room for, in the bounds of the result.
// Threads: pure. Real-time.

/// A crossing counts in the gaps of all contacts.
void include(const Contact& crossing, PairQueryResult& result) noexcept;

/// The contact is not listed. Its gap counts up to `margin` [m].
void drop(const Contact& contact, double margin, PairQueryResult& result) noexcept;

/// Keeps the contacts up to a gap of `margin` [m].
void keepWithin(double margin, ContactList& contacts, PairQueryResult& result) noexcept;

/// Keeps the `most` contacts with the smallest gaps, in their order, and drops the others, whose gaps count
/// up to `margin` [m].
void keepNearest(std::size_t most, double margin, ContactList& contacts, PairQueryResult& result) noexcept;

}  // namespace tenon::collision
