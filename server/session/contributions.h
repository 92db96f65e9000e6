#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <tuple>
#include <vector>

#include "idl/types/ids.h"
#include "server/session/input_buffer.h"

namespace tenon::session {

/// Forces and poses that clients contribute, on their way to the tick: of each client a few at a time, the
/// newest of each object and source, so that no client fills the queue that commands use.
///
/// Threads: one (wire). Real-time: no.
class Contributions {
 public:
  static constexpr std::size_t kMostOfClient = 8;  ///< at a time

  /// False, and it is dropped, when others of the client wait already.
  bool put(ClientId client, const Change& change) {
    std::vector<Change>& waiting = waiting_[client];
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

  /// Moves one of each client in turn, as long as the queue is less than half full.
  void forward(InputBuffer& to) {
    for (bool moved = true; moved;) {
      moved = false;
      for (auto& [client, waiting] : waiting_) {
        if (waiting.empty() || to.freeChanges() < InputBuffer::kChanges / 2) continue;
        to.put(waiting.front());
        waiting.erase(waiting.begin());
        moved = true;
      }
    }
  }

 private:
  std::map<ClientId, std::vector<Change>> waiting_;
};

}  // namespace tenon::session
