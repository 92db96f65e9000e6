#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "idl/types/result.h"

namespace tenon::report {

/// The session inside a report: what the console's player shows of a recording, small enough for one file.
struct EmbeddedSession {
  /// A complete MCAP recording: states and events as they were, poses, hands and contacts at `rate`, rounded
  /// to 2^-16 m.
  std::vector<std::uint8_t> recording;
  double rate = 0.0;  ///< [Hz] 30, or what fits
  /// Display models by name, one level an object, and under the announced name the list of them.
  std::map<std::string, std::vector<std::uint8_t>> assets;
  std::size_t objects = 0;  ///< of the scene
  std::size_t models = 0;   ///< objects whose model is there
};

/// Takes from a recording what the player needs, in about `budget` [bytes] altogether: first coarser models,
/// then fewer poses a second. Models come from the folder `cache`, or, where it has none of them, from the
/// recording; those that are missing are drawn as boxes. Fails with a sentence when `file` cannot be read,
/// has no poses at 30 Hz, or does not fit.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<EmbeddedSession> embedSession(const std::filesystem::path& file,
                                                   const std::filesystem::path& cache, std::size_t budget);

}  // namespace tenon::report
