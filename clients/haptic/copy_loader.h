#pragma once

#include <atomic>
#include <future>
#include <memory>
#include <optional>
#include <string>

#include "clients/haptic/force_model_chooser.h"
#include "clients/haptic/scene_source.h"
#include "clients/haptic/station.h"

namespace tenon::haptic {

/// Gets the server's compiled scene for the force model `scene copy` of a station's hands: before the first
/// step if that was asked for, else beside the session, once the link turns out to be long. Copies for the
/// hands of a new seat are made likewise, since devices get no writes while a station restarts.
///
/// Threads: one, which gives the copies to the station; loading and making have their own. Real-time: no.
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
  /// Copies for the hands of a new seat, where there is a scene: before renew() returns, or by takeOutcome().
  void renew();
  void renewBeside();
  /// How loading or making beside the session ended, once it has: the station has its copies.
  [[nodiscard]] std::optional<Result<void>> takeOutcome();
  /// There is a scene to copy.
  [[nodiscard]] bool loaded() const noexcept { return scene_ != nullptr; }
  /// Ends loading, if it runs.
  void cancel() noexcept { cancelled_ = true; }

 private:
  struct Loaded {
    std::shared_ptr<const simulation::Scene> scene;
    SceneCopies copies;
  };
  void give(Loaded loaded);

  Station& station_;
  const SceneSource& source_;
  ForceModelWish wish_;
  std::shared_ptr<const simulation::Scene> scene_;
  bool missing_ = false;
  std::atomic<bool> cancelled_{false};
  std::future<Result<Loaded>> loading_;
};

}  // namespace tenon::haptic
