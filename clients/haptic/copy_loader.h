#pragma once

#include <atomic>
#include <future>
#include <optional>
#include <string>

#include "clients/haptic/force_model_chooser.h"
#include "clients/haptic/scene_source.h"
#include "clients/haptic/station.h"

namespace tenon::haptic {

/// Gets the server's compiled scene for the force model `scene copy` of a station's hands: before the first
/// step if that was asked for, else beside the session, once the link turns out to be long.
///
/// Threads: one; loading has its own. Real-time: no.
class CopyLoader {
 public:
  /// `source` and `station` outlive this.
  CopyLoader(Station& station, const SceneSource& source, ForceModelWish wish)
      : station_(station), source_(source), wish_(wish) {}
  ~CopyLoader() { cancel(); }

  /// Before the first step. Loads nothing unless the copy was asked for; fails when it cannot be had.
  [[nodiscard]] Result<void> loadIfAsked(const std::string& scene_hash,
                                         const std::function<void(const std::string&)>& print,
                                         const std::atomic<bool>& stop);
  /// Once, where the station chooses for itself.
  void loadBeside(const std::string& scene_hash);
  /// How loading ended, once it has.
  [[nodiscard]] std::optional<Result<void>> takeOutcome();
  /// The hands have their copies.
  [[nodiscard]] bool loaded() const noexcept { return loaded_; }
  /// Ends loading, if it runs.
  void cancel() noexcept { cancelled_ = true; }

 private:
  Result<void> load(const std::string& scene_hash, const std::function<void(const std::string&)>& print,
                    const std::atomic<bool>& stop);

  Station& station_;
  const SceneSource& source_;
  ForceModelWish wish_;
  bool loaded_ = false, missing_ = false;
  std::atomic<bool> cancelled_{false};
  std::future<Result<void>> loading_;
};

}  // namespace tenon::haptic
