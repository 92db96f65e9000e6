#pragma once

#include <cstddef>
#include <vector>

#include "server/collision/island_solver.h"

namespace tenon::simulation {

/// Preallocated contact lists for the pairs that need one: a list takes about 40 kB, too much for each of
/// 20,000 pairs.
///
/// Pointers to lists stay valid when the pool is moved. Threads: one at a time. Real-time: everything but the
/// constructor.
class ContactListPool {
 public:
  explicit ContactListPool(std::size_t lists) : lists_(lists) {
    for (collision::IslandPairResult& list : lists_) list.multipliers.resize(collision::kMaxPairContacts);
    free_.reserve(lists);
    for (std::size_t i = lists; i-- > 0;) free_.push_back(&lists_[i]);
  }
  ContactListPool(const ContactListPool&) = delete;
  ContactListPool& operator=(const ContactListPool&) = delete;
  ContactListPool(ContactListPool&&) = default;
  ContactListPool& operator=(ContactListPool&&) = default;

  [[nodiscard]] std::size_t size() const { return lists_.size(); }
  [[nodiscard]] std::size_t free() const { return free_.size(); }
  /// An empty list; null when all are in use.
  [[nodiscard]] collision::IslandPairResult* acquire() noexcept {
    if (free_.empty()) return nullptr;
    collision::IslandPairResult* list = free_.back();
    free_.pop_back();
    list->query.contacts.clear();
    list->traversal = collision::TraversalState{};
    list->F_Ao_W = Wrench{};
    return list;
  }
  /// Null is allowed.
  void release(collision::IslandPairResult* list) noexcept {
    if (list != nullptr) free_.push_back(list);
  }

 private:
  std::vector<collision::IslandPairResult> lists_;
  std::vector<collision::IslandPairResult*> free_;
};

}  // namespace tenon::simulation
