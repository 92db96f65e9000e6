#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "clients/haptic/person.h"
#include "clients/haptic/station.h"
#include "idl/types/result.h"

namespace tenon {

struct InstructorOptions {
  std::string device = "sigma7-sim";  ///< or falcon-sim, omega3-sim
  PersonOptions person;
  bool simulated_person = true;  ///< moves a simulated device; false: somebody else does
};

/// The instructor's station: a desk device that moves the teaching assistant (hand `instructor`, paper §4.4).
///
/// Threads, Real-time: as Station.
class InstructorStation : public Station {
 public:
  static Result<std::unique_ptr<InstructorStation>> open(const InstructorOptions& options);
  ~InstructorStation() override;

  [[nodiscard]] std::vector<std::string> handNames() const override;
  [[nodiscard]] Role role() const override { return Role::kInstructor; }
  void step(std::uint32_t seq) noexcept override;
  /// What the instructor is doing, in a word or two: for progress and tests.
  [[nodiscard]] const char* doing() const noexcept;

 protected:
  void begin(std::span<const HandId> hand_ids) override;
  void heard(const HandManifold& manifold) noexcept override;
  void stepChanged() override;
  void stopChanged(bool engaged) override;

 private:
  struct Parts;
  explicit InstructorStation(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace tenon
