#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <vector>

#include "clients/console/channel.h"

namespace tenon::console {

/// All channels and what late subscribers get of them: the newest message of each instance, kMaxEvents of a
/// Delivery::kEach channel. Of more events those that come most often make room, the oldest first: a warning
/// that repeats forgets no event that was told once. Instances beyond kMaxInstances of a channel are not
/// kept.
///
/// Threads: one. Real-time: no.
class ChannelStore {
 public:
  static constexpr std::size_t kMaxEvents = 1'000;
  static constexpr std::size_t kMaxInstances = 4'000;

  explicit ChannelStore(std::vector<Channel> channels)
      : channels_(std::move(channels)), kept_(channels_.size()) {}

  [[nodiscard]] const std::vector<Channel>& channels() const { return channels_; }
  /// Null when there is no such channel.
  [[nodiscard]] const Channel* find(ChannelId id) const;
  void keep(const Publication& publication);
  /// Forgets all messages: another session begins.
  void clear() { kept_.assign(channels_.size(), {}); }
  void forEachKept(ChannelId id, const std::function<void(const Publication&)>& handler) const;

 private:
  struct Kept {
    std::map<std::uint64_t, Publication> newest;
    std::deque<Publication> events;
    std::map<std::uint64_t, std::size_t> counts;  ///< of events, by instance; none is 0
  };
  static void dropEvent(Kept& kept);
  std::vector<Channel> channels_;  ///< channel `id` at id - 1
  std::vector<Kept> kept_;
};

}  // namespace tenon::console
