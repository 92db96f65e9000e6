#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "clients/console/seat_rights.h"
#include "clients/console/web_options.h"

namespace tenon::console {

/// The seats of people at browsers. Each has a client of the session of its own, so that the server grants
/// its rights by what the browser has proven and knows each person; and a thread of its own, so that one who
/// waits for an answer delays nobody. The emergency stop needs no seat.
///
/// Roles are given by membershipOf().
///
/// Threads: any; no function waits but the destructor. `answer` is called by threads of the desk.
/// Real-time: no.
class Desk {
 public:
  using Answer = std::function<void(ViewerId, const DeskAnswer&)>;

  Desk(SeatRights rights, Answer answer);
  ~Desk();
  Desk(const Desk&) = delete;
  Desk& operator=(const Desk&) = delete;

  /// Each request is answered once. `session`: its name; empty: not known yet, which the emergency stop takes
  /// for all sessions.
  void handle(ViewerId viewer, const std::string& session, const DeskRequest& request);
  /// The viewer's seat is given up.
  void left(ViewerId viewer);
  /// Prepares an emergency stop for this session, so that it takes effect at once.
  void expect(const std::string& session);

 private:
  class Seat;
  class Stopper;

  [[nodiscard]] std::optional<DeskAnswer> sit(ViewerId viewer, const std::string& session,
                                              const DeskRequest& request);
  void leave(ViewerId viewer);

  SeatRights rights_;
  Answer answer_;
  std::mutex mutex_;
  std::map<ViewerId, std::unique_ptr<Seat>> seats_;
  std::vector<std::unique_ptr<Seat>> left_;  ///< their threads end
  std::unique_ptr<Stopper> stopper_;
};

}  // namespace tenon::console
