#pragma once

#include <atomic>

#include "devices/drivers/remote_model.h"
#include "idl/threads/latest.h"

namespace tenon::devices {

/// A RemoteModel whose peer is a browser, behind a gateway that lives in the same process. A person at a
/// mouse is not pushed back, so the hand stays within 20 mm and 0.15 rad of its proxy wherever the target is:
/// it pushes with 20 N at most.
///
/// A browser draws while it does nothing else, so it counts as silent after 500 cycles, and as gone after
/// 10,000.
///
/// Threads: move from one, takeView from one, isGone from any; the others as HapticDevice. Real-time: move,
/// and as HapticDevice.
class BrowserDevice final : public RemoteModel {
 public:
  static constexpr RemoteLimits kLimits{
      .silent = 500, .gone = 10'000, .reach = 0.020, .turn = 0.15, .stiffness = 1000.0};

  BrowserDevice() : RemoteModel(kLimits) { meetPeer(); }

  void move(const RemoteTarget& target) noexcept { targets_.write(target); }
  /// The newest view; false when none is new.
  [[nodiscard]] bool takeView(RemoteView& view) noexcept {
    if (!views_.update()) return false;
    view = views_.value();
    return true;
  }
  /// Nothing was heard of the browser for too long.
  [[nodiscard]] bool isGone() const noexcept { return is_gone_; }

 private:
  void receive() noexcept override {
    if (targets_.update()) lead(targets_.value());
  }
  void send(const RemoteView& view) noexcept override { views_.write(view); }
  void giveUp() noexcept override {
    losePeer();
    is_gone_ = true;
  }

  threads::Latest<RemoteTarget> targets_;
  threads::Latest<RemoteView> views_;
  std::atomic<bool> is_gone_{false};
};

}  // namespace tenon::devices
