#pragma once

#include <atomic>
#include <chrono>
#include <string>

#include "clients/observer/observer.h"
#include "idl/types/result.h"

namespace tenon {

struct ObserverProgramOptions {
  std::string session;  ///< empty: the first one announced
  std::uint32_t domain = 0;
  std::string person = "observer";
  std::chrono::seconds patience{10};  ///< for a server to be found
};

/// Joins a session as observer and feeds `observer` until the run is over, the server is gone or `stop` is
/// set.
///
/// Threads: one. Real-time: no.
Result<void> observe(Observer& observer, const ObserverProgramOptions& options,
                     const std::atomic<bool>& stop);

}  // namespace tenon
