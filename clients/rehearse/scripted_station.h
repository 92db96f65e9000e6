#pragma once

#include <string>
#include <utility>
#include <vector>

#include "clients/haptic/station.h"
#include "clients/station/hand_trajectory.h"

namespace tenon::rehearse {

/// A station without device and person: its hand has the poses of a trajectory. Input `seq` has the pose and
/// the mean velocity over the last millisecond at `seq` ms.
///
/// Threads, Real-time: as Station.
class ScriptedStation final : public haptic::Station {
 public:
  ScriptedStation(std::string hand, Role role, station::HandTrajectory trajectory)
      : hand_(std::move(hand)), role_(role), trajectory_(std::move(trajectory)) {}

  [[nodiscard]] std::vector<std::string> handNames() const override { return {hand_}; }
  [[nodiscard]] Role role() const override { return role_; }
  void step(std::uint32_t seq) noexcept override;
  [[nodiscard]] Result<void> armDevices() override { return {}; }

 protected:
  void begin(std::span<const HandId>) override {}
  void manifoldReceived(const HandManifold&) noexcept override {}
  void armingChanged() noexcept override {}

 private:
  std::string hand_;
  Role role_;
  station::HandTrajectory trajectory_;
};

}  // namespace tenon::rehearse
