#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "idl/types/result.h"
#include "server/session/session_simulation.h"
#include "server/session/tick_io.h"

namespace tenon::rehearse {

struct TickLogOptions {
  Tick every = 1;       ///< [ticks] from one logged tick to the next
  bool timing = false;  ///< with the time that each tick took: equal runs give different bytes
};

/// Writes ticks of a session as JSON lines; docs/bake.md describes the members. Numbers are the shortest
/// decimals that read back as the same double (null when not finite), so equal runs give equal bytes.
///
/// Threads: one. Real-time: no.
class TickLog {
 public:
  /// Overwrites `file`. Fails when it cannot be written.
  [[nodiscard]] static Result<TickLog> open(const std::filesystem::path& file, const TickLogOptions& options);
  /// Appends the state after a tick when it is one of those to log.
  void write(const session::SessionSimulation& simulation, const session::TickOutput& output);
  /// Fails when anything could not be written.
  [[nodiscard]] Result<void> close();

 private:
  void addHands(const session::SessionSimulation& simulation, const session::TickOutput& output);
  void addObjects(const session::SessionSimulation& simulation);
  void addPairs(const session::SessionSimulation& simulation, const session::TickOutput& output);

  std::filesystem::path file_;
  TickLogOptions options_;
  std::ofstream stream_;
  std::string line_;
};

}  // namespace tenon::rehearse
