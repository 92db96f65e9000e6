#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include "idl/types/ids.h"
#include "server/session/input_buffer.h"

namespace tenon::session {

/// Forces and poses that clients contribute, on their way to the tick: of each client a few at a time, the
/// newest of each object and source, so that no client fills the queue that commands use.
///
/// Forces end with the client that contributed them.
///
/// Threads: one (wire). Real-time: no.
class Contributions {
 public:
  static constexpr std::size_t kMostOfClient = 8;  ///< at a time
  /// Forces of a client that end when it leaves, the newest ones; others end with their lifetime,
  /// ForceBuffer::kMaxLifetimeTicks at most.
  static constexpr std::size_t kMostEnded = 16;

  /// False, and it is dropped, when others of the client wait already.
  bool put(ClientId client, const Change& change) {
    std::vector<Change>& waiting = clients_[client].waiting;
    const auto key = [](const Change& c) { return std::tuple(c.kind, c.object, c.index); };
    const auto same =
        std::find_if(waiting.begin(), waiting.end(), [&](const Change& c) { return key(c) == key(change); });
    if (same != waiting.end()) {
      *same = change;
    } else if (waiting.size() < kMostOfClient) {
      waiting.push_back(change);
    } else {
      return false;
    }
    return true;
  }

  /// The client has left: what waits is dropped, and its forces become zero.
  void end(ClientId client) {
    const auto found = clients_.find(client);
    if (found == clients_.end()) return;
    for (const auto& [object, source] : found->second.forces)
      ends_.push_back(
          {.kind = ChangeKind::kContributeForce, .object = object, .index = source, .lifetime_ticks = 1});
    clients_.erase(found);
  }

  /// Moves the ends of forces, then one of each client in turn, as long as the queue is less than half full.
  void forward(InputBuffer& to) {
    const auto isFull = [&to] { return to.freeChanges() < InputBuffer::kChanges / 2; };
    while (!ends_.empty() && !isFull()) {
      to.put(ends_.front());
      ends_.erase(ends_.begin());
    }
    for (bool moved = true; moved;) {
      moved = false;
      for (auto& [client, of_client] : clients_) {
        if (of_client.waiting.empty() || isFull()) continue;
        const Change change = of_client.waiting.front();
        of_client.waiting.erase(of_client.waiting.begin());
        to.put(change);
        if (change.kind == ChangeKind::kContributeForce) note(client, {change.object, change.index});
        moved = true;
      }
    }
  }

 private:
  using Cell = std::pair<ObjectId, std::uint32_t>;  ///< of a force: its object and source

  struct Client {
    std::vector<Change> waiting;
    std::vector<Cell> forces;  ///< that the simulation has got last from this client, in their order
  };

  /// `client` has overwritten the force in `cell`.
  void note(ClientId client, const Cell& cell) {
    for (auto& [other, of_other] : clients_) std::erase(of_other.forces, cell);
    std::vector<Cell>& forces = clients_[client].forces;
    if (forces.size() >= kMostEnded) forces.erase(forces.begin());
    forces.push_back(cell);
  }

  std::map<ClientId, Client> clients_;
  std::vector<Change> ends_;  ///< waiting
};

}  // namespace tenon::session
