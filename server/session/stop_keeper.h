#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "idl/types/stop_truth.h"
#include "server/session/server_writers.h"

namespace tenon::session {

/// The emergency stop at the server: which raises stand, in memory, on the bus and in the stop file.
///
/// The server publishes every raise itself, for late joiners and in case its writer leaves, and it alone
/// publishes clears.
///
/// Threads: one (wire). Real-time: no.
class StopKeeper {
 public:
  /// `file`: empty: only in memory. `writers` must outlive this.
  StopKeeper(std::filesystem::path file, ServerWriters& writers)
      : file_(std::move(file)), writers_(writers) {}

  /// Takes what the file has, and publishes it. Fails when the file is damaged.
  [[nodiscard]] Result<void> restore();
  /// Whether this raise now stands and did not before: then publish() follows, once the simulation is
  /// stopped.
  [[nodiscard]] bool raise(const EmergencyStop& stop) { return truth_.raise(stop); }
  /// Of a raise that stands. It waits for the disk.
  void publish(const EmergencyStop& stop);
  /// Clears all raises that stand, and those alone: one that is on its way will stand.
  void clear(const std::string& who, const std::string& reason);
  [[nodiscard]] bool engaged() const { return truth_.engaged(); }

  /// Called when the stop would not outlive a crash of the server; may be empty.
  std::function<void(const std::string& why)> not_kept;

 private:
  void keep();

  std::filesystem::path file_;
  ServerWriters& writers_;
  StopTruth truth_;
};

}  // namespace tenon::session
