#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "idl/types/result.h"

namespace tenon::simulation {
struct Scene;
}

namespace tenon::haptic {

/// Where a station finds the compiled scene of its server.
struct SceneSource {
  std::filesystem::path cache;  ///< folder whose `assets` are looked through first, and keep what is fetched
  std::string url;              ///< of a console of the server, http://HOST[:PORT]; empty: the cache alone
};

/// The compiled scene that the list `scene_hash` of a SessionAnnounce names. `print` gets what is fetched and
/// how far, a line at a time; may be empty. Fails with a sentence when it is not there, cannot be fetched or
/// is damaged, or when `stop` is set.
///
/// Threads: one. Real-time: no.
[[nodiscard]] Result<std::shared_ptr<const simulation::Scene>> openScene(
    const SceneSource& source, std::string_view scene_hash,
    const std::function<void(const std::string&)>& print, const std::atomic<bool>& stop);

}  // namespace tenon::haptic
