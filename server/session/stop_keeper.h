#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "idl/types/stop_truth.h"
#include "server/session/file_keeper.h"
#include "server/session/server_writers.h"

namespace tenon::session {

/// The emergency stop at the server: which raises stand, in memory, on the bus and in the stop file.
///
/// The server publishes every raise itself, for late joiners and in case its writer leaves, and it alone
/// publishes clears. A raise acts and is published at once, while another thread writes it to the file. A
/// clear is published once it is in the file, or could not be written there: so a server that is killed does
/// not come back with a stop that clients were told is over, nor without one, unless it is killed in the
/// milliseconds in which the raise is written (docs/safety.md).
///
/// Raises beyond the bounds of StopTruth are published as cleared: those before them stand.
///
/// A stop that stands at its start is raised once more, by the server: who was told of a clear that had not
/// come into the file hears no raise of before any more, and must be told that it stands again.
///
/// Threads: one (wire), which never waits for the disk; another one, of this object, writes the file.
/// Real-time: no.
class StopKeeper {
 public:
  /// `file`: empty: only in memory. `writers` must outlive this. `server_epoch`: by which raises have other
  /// numbers than in a former life of the server.
  StopKeeper(std::filesystem::path file, ServerWriters& writers, std::uint32_t server_epoch);

  /// Takes what the file has, raises it again if it stands, and publishes it. Fails when the file is damaged.
  [[nodiscard]] Result<void> restore();
  /// True when this raise is new (StopTruth): then publish() follows, once the simulation is stopped.
  [[nodiscard]] StopChange raise(const EmergencyStop& stop) { return note(truth_.raise(stop)); }
  /// Of what raise() has told: as a raise that stands, in place of its client's former one, or as
  /// superfluous.
  void publish(const EmergencyStop& stop, const StopChange& change);
  /// Clears all raises that stand, and those alone: one that is on its way will stand.
  void clear(const std::string& who, const std::string& reason);
  [[nodiscard]] bool engaged() const { return truth_.engaged(); }
  [[nodiscard]] const NewestRaise& newest() const { return newest_; }
  [[nodiscard]] const StopTruth& truth() const { return truth_; }
  /// A raise of the server's own; each has a larger number than those of former lives.
  [[nodiscard]] EmergencyStop ownRaise(const std::string& reason) const;
  /// One turn of the wire thread: publishes the clears that are in the file by now.
  void step();
  /// Something waits for the next turn.
  [[nodiscard]] bool waits() const { return is_writing_; }

  /// Called when what stands, or its clear, would not outlive a crash of the server; may be empty.
  std::function<void(const std::string& why)> not_kept;

 private:
  StopChange note(StopChange change);
  void tellNewest();

  std::filesystem::path file_;
  ServerWriters& writers_;
  std::uint32_t server_epoch_;
  StopTruth truth_;
  NewestRaise newest_;
  bool has_changed_ = false;  ///< since the newest state that the file was given
  bool is_writing_ = false;
  std::uint64_t number_ = 0;             ///< of the newest state that the file was given
  std::vector<EmergencyClear> ended_;    ///< since that
  std::vector<EmergencyClear> written_;  ///< in that
  std::unique_ptr<FileKeeper> keeper_;   ///< null: no file
};

}  // namespace tenon::session
