#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "clients/console/channel.h"

namespace tenon::console {

/// All channels and what late subscribers get of them: the newest message of each instance, kMaxEvents of a
/// Delivery::kEach channel. Of more events those that their writer tells most often make room, the oldest
/// first: a warning that repeats forgets no event that was told once. Of more than kMaxInstances of a channel
/// the oldest make room. The writer that has most of a channel does so first: whoever floods the bus with
/// names or events forgets its own. What is forgotten is counted.
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
  /// Sentences about what was forgotten: of each channel at first, and whenever it is twice as much.
  [[nodiscard]] std::vector<std::string> toTell();
  void forEachKept(ChannelId id, const std::function<void(const Publication&)>& handler) const;

 private:
  struct Kept {
    struct Newest {
      Publication publication;
      std::uint64_t order = 0;
    };
    struct Counts {
      std::size_t all = 0;
      std::map<std::uint64_t, std::size_t> by_kind;  ///< Publication::instance; none is 0
    };
    std::map<std::uint64_t, Newest> newest;  ///< by instance
    /// Of a writer, its instances in `newest` by their order; none is empty.
    std::map<std::uint64_t, std::map<std::uint64_t, std::uint64_t>> instances;
    std::uint64_t next_order = 0;
    std::deque<Publication> events;
    std::map<std::uint64_t, Counts> counts;  ///< of events, by writer
    std::uint64_t forgotten = 0;             ///< instances or events
    std::uint64_t told = 0;                  ///< of those
  };
  void keepEvent(Kept& kept, const Publication& publication);
  static void dropEvent(Kept& kept);
  void keepNewest(Kept& kept, const Publication& publication);
  void countForgotten(Kept& kept);
  static void dropInstance(Kept& kept, std::uint64_t instance);
  std::vector<Channel> channels_;  ///< channel `id` at id - 1
  std::vector<Kept> kept_;
  bool has_forgotten_ = false;  ///< since toTell()
};

}  // namespace tenon::console
