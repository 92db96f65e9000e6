#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>

#include "clients/haptic/force_model_chooser.h"
#include "clients/haptic/scene_source.h"
#include "clients/haptic/station.h"
#include "idl/types/messages/run.h"
#include "idl/types/result.h"
#include "idl/wire/membership.h"

namespace tenon::haptic {

/// Options of runStation().
struct StationProgramOptions {
  wire::MembershipOptions membership;  ///< its role, hands and seat are set by runStation()
  std::filesystem::path seat_file;     ///< keeps the key of the seat; empty: a new seat at each start
  bool armed = false;                  ///< by its person from the start, as if pressed once
  bool read_keys = false;              ///< the person presses by the return key on the terminal
  bool real_time = true;               ///< request SCHED_FIFO and locked memory
  ForceModelWish force_model = ForceModelWish::kAuto;
  SceneSource scene;                              ///< for the force model `scene copy`
  std::string language = "en";                    ///< of the printed instructions
  std::function<void(const std::string&)> print;  ///< one line for the person at the terminal; may be empty
  std::function<void()> seated;                   ///< called once, when it has a seat; may be empty
};

/// Runs a station in a session until the run is over or `stop` is set; returns the last state of the run.
/// After a loss of the connection it rejoins with the key of its seat within the timeout of the membership;
/// fails when it cannot join or rejoin, or has lost its seat repeatedly.
///
/// In real time a servo thread steps the station each millisecond without access to the network, and the
/// calling thread exchanges the messages. In lockstep the calling thread does both, one step for each
/// completely received tick.
///
/// Threads: the caller becomes the wire thread. Real-time: the servo thread's loop.
Result<RunState> runStation(Station& station, const StationProgramOptions& options,
                            const std::atomic<bool>& stop);

/// Flag set by SIGINT and SIGTERM; the first call installs the handlers.
[[nodiscard]] const std::atomic<bool>& stopSignal();

/// From now on SIGINT and SIGTERM end the program at once: for one whose forces are off, and that waits for a
/// device.
void endAtNextSignal();

}  // namespace tenon::haptic
