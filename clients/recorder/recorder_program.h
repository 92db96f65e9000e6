#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <string>

#include "idl/types/messages.h"
#include "idl/types/result.h"

namespace tenon {

struct RecorderOptions {
  std::filesystem::path file;
  std::string session;  ///< empty: the first one announced
  std::uint32_t domain = 0;
  bool lockstep = false;              ///< refuse a session that runs by the clock
  std::chrono::seconds patience{10};  ///< for a server to be found and to answer
  std::function<void(const std::string&)> say;
};

/// Joins a session as recorder and writes all of it until the run is over, the server is gone or `stop` is
/// set. The file gets a proper end in each case.
///
/// It listens before it asks for its seat, so a server that waits for a recorder is recorded from its first
/// tick.
///
/// Threads: one. Real-time: no.
Result<RecorderStatus> record(const RecorderOptions& options, const std::atomic<bool>& stop);

}  // namespace tenon
