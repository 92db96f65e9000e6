#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "clients/recorder/recording.h"
#include "idl/types/cache_folder.h"
#include "idl/types/messages/run.h"
#include "idl/types/result.h"

namespace tenon::recorder {

struct RecorderOptions {
  std::filesystem::path file;
  std::string session;  ///< empty: the first one announced
  std::uint32_t domain = 0;
  std::filesystem::path key_file;  ///< of the session; empty: wire::defaultKeyFile()
  std::filesystem::path assets = defaultCache() / "assets";  ///< of wire::AssetStore: display models
  std::string assets_url;  ///< of a console at the server, for those that are not there; empty: boxes
  bool all = false;        ///< Streams::kAll
  bool lockstep = false;   ///< refuse a session that runs in real time
  std::chrono::seconds timeout{10};                ///< for a server to be found and to answer
  std::function<void(const std::string&)> report;  ///< progress, one line per call; may be empty
};

/// What a recording holds.
struct RecordingReport {
  RecorderStatus status;
  std::vector<TopicCount> counts;  ///< by topic
  std::vector<std::string> boxes;  ///< names of objects that it shows as boxes, for lack of their models

  /// Ticks whose inputs are not in it: a re-simulation ends at the first of them.
  [[nodiscard]] std::uint64_t missingTicks() const;
};

/// Joins a session as recorder and writes all its topics until the run is over, the server is lost or `stop`
/// is set. The file is completed (summary and index) in each case. Fails with a sentence when no session is
/// found, joining is refused, the file cannot be written, or the server is lost before the run is over.
///
/// Subscribes before it joins, so a server that waits for a recorder is recorded from its first tick. At the
/// end it waits for all that the server states to have published; in real time, where streams are best
/// effort, a part of them may never come.
///
/// Threads: one. Real-time: no.
[[nodiscard]] Result<RecordingReport> recordSession(const RecorderOptions& options,
                                                    const std::atomic<bool>& stop);

}  // namespace tenon::recorder
