#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <thread>
#include <utility>

#include "clients/haptic/station.h"

namespace tenon::haptic {

/// Resets and arms a station's devices beside the thread that hears the emergency stop: a device may take its
/// time, or never answer.
///
/// Threads: one (wire), which starts another one. Real-time: no.
class ArmingThread {
 public:
  /// `station` outlives this; `print` gets what a device says, from the other thread.
  ArmingThread(Station& station, std::function<void(const std::string&)> print)
      : station_(station), print_(std::move(print)) {}
  ArmingThread(const ArmingThread&) = delete;
  ArmingThread& operator=(const ArmingThread&) = delete;
  ~ArmingThread() {
    if (thread_.joinable()) thread_.join();
  }

  /// Begins, if the station wants it and no arming is under way.
  void start();
  [[nodiscard]] bool isUnderWay() const { return under_way_; }
  /// Until no arming is under way, calls `hear`, which may wait for messages.
  template <class Hear>
  void await(const Hear& hear) const {
    while (isUnderWay()) hear();
  }

 private:
  Station& station_;
  std::function<void(const std::string&)> print_;
  std::atomic<bool> under_way_ = false;
  std::thread thread_;
};

}  // namespace tenon::haptic
