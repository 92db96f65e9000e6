#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "clients/haptic/person.h"
#include "clients/haptic/station.h"
#include "clients/haptic/tactile_map.h"
#include "idl/types/result.h"

namespace tenon {

struct TraineeOptions {
  std::string device = "hug-sim";  ///< a pair of arms
  std::string tactors = "vibrotac-sim";
  bool swap_hands = false;  ///< the right arm moves hand `left` and the left arm hand `right`
  TactileMode tactile = TactileMode::kIntensity;
  PersonOptions person;
  bool simulated_person = true;  ///< moves simulated arms; false: somebody else does
};

/// The trainee's station: two arms (hands `right` and `left`), a tracked forearm with an arm band (`forearm`)
/// and a tracked head (`head`).
///
/// Threads, Real-time: as Station.
class TraineeStation : public Station {
 public:
  static Result<std::unique_ptr<TraineeStation>> open(const TraineeOptions& options);
  ~TraineeStation() override;

  [[nodiscard]] std::vector<std::string> handNames() const override;
  [[nodiscard]] Role role() const override { return Role::kTrainee; }
  void step(std::uint32_t seq) noexcept override;
  /// What she is doing, in a word or two: for progress and tests.
  [[nodiscard]] const char* doing() const noexcept;

 protected:
  void begin(std::span<const HandId> hand_ids) override;
  void heard(const HandManifold& manifold) noexcept override;
  void stepChanged() override;
  void stopChanged(bool engaged) override;

 private:
  struct Parts;
  void trackBody(std::uint32_t seq, double dt) noexcept;
  explicit TraineeStation(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace tenon
