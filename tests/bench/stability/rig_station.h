#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "clients/haptic/haptic_hand.h"
#include "clients/haptic/station.h"
#include "devices/safety.h"

namespace tenon::bench {

/// How the force of a hand is made.
enum class RigModel {
  kStreamed,  ///< the server's coupling force as it arrives, into the device: a baseline of this rig alone
  kStreamedPassive,  ///< likewise, through the safety layer with its passivity observer
  kManifold,         ///< the product's station: contacts of the server, coupling, safety layer
  kSceneCopy,        ///< likewise, with contacts of its own copy of the scene
};

/// A station of one hand with a device. Streamed forces bypass what a station has of its own.
///
/// Threads, Real-time: as Station.
class RigStation final : public haptic::Station {
 public:
  /// `device` outlives the station, which calls `before_step` with the time [s] of the next reading.
  RigStation(std::string hand, const Vector3& p_WD, RigModel model, devices::HapticDevice& device,
             std::function<void(double)> before_step);

  [[nodiscard]] std::vector<std::string> handNames() const override { return {hand_name_}; }
  [[nodiscard]] std::vector<HandStiffness> stiffness() const override { return {stiffness_}; }
  /// Instead of what the device renders.
  void setStiffness(const HandStiffness& stiffness) { stiffness_ = stiffness; }
  /// Of the coupling, as the server has told it last.
  [[nodiscard]] double coupling() const { return newest_.stiffness; }
  [[nodiscard]] Role role() const override { return Role::kTrainee; }
  [[nodiscard]] Result<void> armDevices() override { return {}; }
  void setCopies(haptic::SceneCopies&& copies) override { hand_.setCopy(std::move(copies.at(0))); }
  [[nodiscard]] haptic::ForceModelKind forceModel() const noexcept override {
    return model_ == RigModel::kSceneCopy ? haptic::ForceModelKind::kSceneCopy
                                          : haptic::ForceModelKind::kManifold;
  }
  using haptic::Station::receive;
  void receive(const CollisionMatrix& matrix) noexcept override { hand_.receive(matrix); }
  void step(std::uint32_t seq) noexcept override;

 protected:
  void begin(std::span<const HandId> hands) override;
  void manifoldReceived(const HandManifold& manifold) noexcept override;
  void armingChanged() noexcept override {}

 private:
  void stepStreamed(std::uint32_t seq) noexcept;

  std::string hand_name_;
  Vector3 p_WD_;
  RigModel model_;
  devices::HapticDevice& device_;
  std::function<void(double)> before_step_;
  haptic::HapticHand hand_;
  devices::Safety safety_;  ///< of streamed forces
  HandStiffness stiffness_;
  HandManifold newest_;
};

}  // namespace tenon::bench
