#pragma once

#include <cstddef>
#include <vector>

#include "server/collision/island_solver.h"

namespace tenon {

/// Room for the contact lists of the pairs that are near each other, made at start: a list takes some 40 kB,
/// so of 20,000 pairs only those may have one that need it.
///
/// Moving it leaves the rooms where they are. Threads: one at a time. Real-time: everything but the
/// constructor.
class ContactRooms {
 public:
  explicit ContactRooms(std::size_t rooms) : rooms_(rooms) {
    for (IslandPairResult& room : rooms_) room.multipliers.resize(kMaxPairContacts);
    free_.reserve(rooms);
    for (std::size_t i = rooms; i-- > 0;) free_.push_back(&rooms_[i]);
  }
  ContactRooms(const ContactRooms&) = delete;
  ContactRooms& operator=(const ContactRooms&) = delete;
  ContactRooms(ContactRooms&&) = default;
  ContactRooms& operator=(ContactRooms&&) = default;

  [[nodiscard]] std::size_t size() const { return rooms_.size(); }
  [[nodiscard]] std::size_t free() const { return free_.size(); }
  /// Null when all are taken.
  [[nodiscard]] IslandPairResult* take() noexcept {
    if (free_.empty()) return nullptr;
    IslandPairResult* room = free_.back();
    free_.pop_back();
    room->query.contacts.clear();
    room->walked = WalkedAt{};
    room->F_Ao_W = Wrench{};
    return room;
  }
  void giveBack(IslandPairResult* room) noexcept {
    if (room != nullptr) free_.push_back(room);
  }

 private:
  std::vector<IslandPairResult> rooms_;
  std::vector<IslandPairResult*> free_;
};

}  // namespace tenon
