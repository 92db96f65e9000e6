#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "clients/haptic/station.h"
#include "server/session/exercise.h"
#include "server/session/scene_loader.h"
#include "server/session/tick_io.h"

namespace tenon {

struct RehearsalOptions {
  std::uint64_t seed = 1;
  unsigned workers = 1;
  double seconds = 600.0;  ///< of session time, at most
  bool collisions = true;  ///< false: nothing touches the scene, the same people try the same
  std::function<void(const EventLog&)> heard;
  std::function<void(const TickInput&, const TickOutput&)> ticked;
  std::function<bool()> enough;  ///< ends the session after a tick
};

struct RehearsalReport {
  RunPhase phase = RunPhase::kWaitingForPeople;
  Tick ticks = 0;
  std::uint64_t final_hash = 0;
  std::string reason;
};

/// A whole session in one process on a virtual clock: the server's exercise and the stations of people, each
/// tick fed with what the other said one tick ago, as in lockstep over DDS and to the same bits (DESIGN
/// section 5).
///
/// Threads: one, and the exercise's workers.
[[nodiscard]] Result<RehearsalReport> rehearse(const LoadedScene& loaded,
                                               std::vector<std::unique_ptr<Station>> stations,
                                               const RehearsalOptions& options);

}  // namespace tenon
