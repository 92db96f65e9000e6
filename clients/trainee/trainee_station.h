#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "clients/haptic/station.h"
#include "clients/haptic/tactile_map.h"
#include "clients/simulated_person/person.h"
#include "devices/catalog.h"
#include "idl/types/result.h"

namespace tenon::trainee {

struct TraineeOptions {
  std::string device{devices::kTraineeDevice};  ///< bimanual haptic device
  std::string tactors = "vibrotac-sim";         ///< vibrotactile bracelet
  bool swap_hands = false;  ///< the right arm moves hand `left` and the left arm hand `right`
  haptic::TactileMode tactile = haptic::TactileMode::kIntensity;
  simulated_person::PersonOptions person;
  bool simulated_person = true;  ///< a simulated trainee moves the simulated arms; false: they move otherwise
};

/// The trainee's station: a bimanual haptic device (hands `right` and `left`), a tracked forearm with a
/// vibrotactile bracelet (`forearm`) and a tracked head (`head`).
///
/// Threads, Real-time: as Station.
class TraineeStation : public haptic::Station {
 public:
  /// Fails with a sentence when a device is unknown or cannot be opened.
  static Result<std::unique_ptr<TraineeStation>> open(const TraineeOptions& options);
  ~TraineeStation() override;

  [[nodiscard]] std::vector<std::string> handNames() const override;
  [[nodiscard]] Role role() const override { return Role::kTrainee; }
  void step(std::uint32_t seq) noexcept override;
  /// What the simulated trainee does, in a word or two: for progress output and tests.
  [[nodiscard]] const char* activity() const noexcept;

 protected:
  void begin(std::span<const HandId> hand_ids) override;
  void manifoldReceived(const HandManifold& manifold) noexcept override;
  void stepChanged() override;
  void armingChanged() noexcept override;

 private:
  struct Parts;
  /// Poses of forearm and head, and the vibration of the bracelet; `dt` [s].
  void trackBody(std::uint32_t seq, double dt) noexcept;
  void armBracelet() noexcept;
  explicit TraineeStation(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace tenon::trainee
