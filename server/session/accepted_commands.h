#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "idl/types/messages/commands.h"
#include "server/session/tick_io.h"

namespace tenon::session {

/// "Ada: goto insert_peg": a command as the log of events tells it.
[[nodiscard]] std::string commandText(const Command& command, const std::string& who);

/// The commands to the state machine that were accepted and that no tick has carried out yet, oldest first:
/// those on their way to the simulation and those that wait in it. The simulation takes and drops them in
/// this order; it knows neither names nor people, so it counts them, and which ones it has dropped is found
/// here.
///
/// Threads: one (wire). Real-time: no.
class AcceptedCommands {
 public:
  void add(std::string text) { waiting_.push_back(std::move(text)); }
  /// After a tick, with its TickOutput::commands; `is_over`: so is the run.
  void update(const CommandCounts& counts, bool is_over);
  [[nodiscard]] std::size_t waiting() const { return waiting_.size(); }
  /// "Ada: goto insert_peg (why)": those that were dropped since the last call.
  [[nodiscard]] std::vector<std::string> takeDropped();

 private:
  void drop(std::uint64_t count, const char* why);

  std::deque<std::string> waiting_;  ///< empty: it was accepted by a server that was killed
  std::vector<std::string> dropped_;
  CommandCounts before_;
  std::uint64_t inherited_ = 0;  ///< waited in the checkpoint that this server began with
  bool has_begun_ = false;
};

}  // namespace tenon::session
