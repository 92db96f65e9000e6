#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "clients/console/channel.h"
#include "idl/types/messages/session.h"

namespace tenon::console {

/// The sessions of the bus, as the channel /lobby of a room of its own: JSON, newest wins. Of more than
/// kMaxSessions those that came last are not listed, which is said, until others end.
///
/// Threads: one. Real-time: no.
class Lobby {
 public:
  static constexpr std::size_t kMaxSessions = 1'000;

  [[nodiscard]] static std::vector<Channel> channels();

  void add(const SessionAnnounce& announce);
  void remove(const SessionAnnounce& gone);
  /// Names, each once.
  [[nodiscard]] std::vector<std::string> names() const;
  /// Sets which of them have no room of their own; returns those that had one until now, or are new.
  std::vector<std::string> setUnserved(std::set<std::string> names);
  /// What has changed since the last call; empty when nothing has.
  [[nodiscard]] std::vector<Publication> take(std::int64_t now_ns);

 private:
  std::map<std::pair<std::string, std::uint32_t>, SessionAnnounce> sessions_;  ///< by name and epoch
  std::map<std::pair<std::string, std::uint32_t>, SessionAnnounce> unlisted_;  ///< likewise, beyond the bound
  std::set<std::string> unserved_;                                             ///< names
  bool has_changed_ = true;
};

}  // namespace tenon::console
