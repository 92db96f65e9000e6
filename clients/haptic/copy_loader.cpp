#include "clients/haptic/copy_loader.h"

#include <chrono>

namespace tenon::haptic {

Result<void> CopyLoader::load(const std::string& scene_hash,
                              const std::function<void(const std::string&)>& print,
                              const std::atomic<bool>& stop) {
  auto scene = openScene(source_, scene_hash, print, stop);
  if (!scene) return fail(scene.error().what);
  station_.setScene(*scene);
  return {};
}

Result<void> CopyLoader::loadIfAsked(const std::string& scene_hash,
                                     const std::function<void(const std::string&)>& print,
                                     const std::atomic<bool>& stop) {
  if (wish_ != ForceModelWish::kSceneCopy) return {};
  if (auto done = load(scene_hash, print, stop); !done)
    return fail("--force-model scene-copy: " + done.error().what);
  loaded_ = true;
  return {};
}

void CopyLoader::loadBeside(const std::string& scene_hash) {
  if (wish_ != ForceModelWish::kAuto || loading_.valid() || loaded_ || missing_) return;
  loading_ = std::async(std::launch::async, [this, scene_hash] { return load(scene_hash, {}, cancelled_); });
}

std::optional<Result<void>> CopyLoader::takeOutcome() {
  if (!loading_.valid() || loading_.wait_for(std::chrono::milliseconds(0)) != std::future_status::ready)
    return std::nullopt;
  Result<void> outcome = loading_.get();
  loaded_ = outcome.has_value();
  missing_ = !loaded_;
  return outcome;
}

}  // namespace tenon::haptic
