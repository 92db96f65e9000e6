#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "idl/types/result.h"
#include "idl/wire/assets.h"

namespace tenon::recorder {

/// Fetches the display models of a session from a console at the server into a store that has not all of
/// them, beside the recording, which waits for none. A model that does not come is a box; the reason is among
/// the lines.
///
/// Threads: one, which no function waits for but the destructor; one of its own. Real-time: no.
class ModelFetch {
 public:
  static constexpr std::uint64_t kMostBytes = 256U << 20U;  ///< [bytes] of all models

  /// `scene_hash`: of the SessionAnnounce; `url`: http://HOST:PORT.
  ModelFetch(wire::AssetStore store, std::string scene_hash, std::string url);
  ~ModelFetch();
  ModelFetch(const ModelFetch&) = delete;
  ModelFetch& operator=(const ModelFetch&) = delete;

  /// Whether the store has got something since the last call.
  [[nodiscard]] bool takeArrivals() { return has_arrivals_.exchange(false); }
  /// What is to be told to people since the last call: how far it is, and how it ended.
  [[nodiscard]] std::vector<std::string> takeLines();

 private:
  [[nodiscard]] Result<void> fetch();
  void say(std::string line);

  const wire::AssetStore store_;
  const std::string scene_hash_, url_;
  std::mutex mutex_;
  std::vector<std::string> lines_;
  std::atomic<bool> has_arrivals_{false}, stop_{false};
  std::thread thread_;
};

}  // namespace tenon::recorder
