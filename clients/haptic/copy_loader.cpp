#include "clients/haptic/copy_loader.h"

#include <chrono>
#include <utility>

#include "clients/haptic/scene_copy.h"

namespace tenon::haptic {

void CopyLoader::give(Loaded loaded) {
  scene_ = std::move(loaded.scene);
  station_.setCopies(std::move(loaded.copies));
}

Result<void> CopyLoader::loadIfAsked(const std::string& scene_hash,
                                     const std::function<void(const std::string&)>& print,
                                     const std::atomic<bool>& stop) {
  if (wish_ != ForceModelWish::kSceneCopy) return {};
  auto scene = openScene(source_, scene_hash, print, stop);
  if (!scene) return fail("--force-model scene-copy: " + scene.error().what);
  give({*scene, copiesOf(*scene, station_.handDevices().size())});
  return {};
}

void CopyLoader::loadBeside(const std::string& scene_hash) {
  if (wish_ != ForceModelWish::kAuto || loading_.valid() || loaded() || missing_) return;
  const auto load = [this, scene_hash, count = station_.handDevices().size()]() -> Result<Loaded> {
    auto scene = openScene(source_, scene_hash, {}, cancelled_);
    if (!scene) return fail(scene.error().what);
    return Loaded{*scene, copiesOf(*scene, count)};
  };
  loading_ = std::async(std::launch::async, load);
}

void CopyLoader::renew() {
  if (loaded()) give({scene_, copiesOf(scene_, station_.handDevices().size())});
}

void CopyLoader::renewBeside() {
  if (!loaded() || loading_.valid()) return;
  const auto copy = [scene = scene_, count = station_.handDevices().size()]() -> Result<Loaded> {
    return Loaded{scene, copiesOf(scene, count)};
  };
  loading_ = std::async(std::launch::async, copy);
}

std::optional<Result<void>> CopyLoader::takeOutcome() {
  if (!loading_.valid() || loading_.wait_for(std::chrono::milliseconds(0)) != std::future_status::ready)
    return std::nullopt;
  Result<Loaded> outcome = loading_.get();
  missing_ = !outcome;
  if (missing_) return Result<void>(fail(outcome.error().what));
  give(std::move(*outcome));
  return Result<void>();
}

}  // namespace tenon::haptic
