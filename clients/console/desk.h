#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "clients/console/desk_recordings.h"
#include "clients/console/seat_rights.h"
#include "clients/console/stopper.h"
#include "clients/console/web_options.h"

namespace tenon::console {

/// The seats of people at browsers. Each has a client of the session of its own, so that the server grants
/// its rights by what the browser has proven and knows each person; and a thread of its own, so that one who
/// waits for an answer delays nobody. The emergency stop needs no seat, and has a thread for each session.
///
/// Roles are given by membershipOf().
///
/// Threads: any; no function waits but expect() and the destructor. `answer` is called by threads of the
/// desk. Real-time: no.
class Desk {
 public:
  using Answer = Stopper::Answer;

  /// `recordings`: folder for those that are started here; empty: none are. `assets`: of display models.
  Desk(SeatRights rights, std::filesystem::path recordings, std::filesystem::path assets, Answer answer);
  ~Desk();
  Desk(const Desk&) = delete;
  Desk& operator=(const Desk&) = delete;

  /// Each request is answered once. `session`: its name; empty: not known yet, which the emergency stop takes
  /// for all sessions.
  void handle(ViewerId viewer, const std::string& session, const DeskRequest& request);
  /// The viewer's seat is given up.
  void left(ViewerId viewer);
  /// Prepares emergency stops for these sessions, so that they take effect at once; empty: for all. Stoppers
  /// of other sessions end once their raises are confirmed.
  void expect(const std::set<std::string>& sessions);
  /// Whether a recording that was started here runs.
  [[nodiscard]] bool records(const std::string& session) { return recordings_.records(session); }

 private:
  class Seat;

  [[nodiscard]] std::optional<DeskAnswer> sit(ViewerId viewer, const std::string& session,
                                              const DeskRequest& request);
  void record(ViewerId viewer, const std::string& session, const DeskRequest& request);
  void leave(ViewerId viewer);
  [[nodiscard]] Stopper& stopperOf(const std::string& session);

  SeatRights rights_;
  Answer answer_;
  DeskRecordings recordings_;
  std::mutex mutex_;
  std::map<ViewerId, std::unique_ptr<Seat>> seats_;
  std::vector<std::unique_ptr<Seat>> left_;                   ///< their threads end
  std::map<std::string, std::unique_ptr<Stopper>> stoppers_;  ///< by session
};

}  // namespace tenon::console
