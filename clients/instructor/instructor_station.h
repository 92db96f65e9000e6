#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "clients/haptic/station.h"
#include "clients/simulated_person/person.h"
#include "devices/catalog.h"
#include "idl/types/result.h"

namespace tenon::instructor {

struct InstructorOptions {
  std::string device{devices::kInstructorDevice};  ///< or falcon-sim, omega3-sim
  simulated_person::PersonOptions person;
  bool simulated_person =
      true;  ///< a simulated instructor moves the simulated device; false: it moves otherwise
};

/// The instructor's station: a desktop haptic device that moves the pointer (teaching assistant; hand
/// `instructor`, paper §4.4).
///
/// Threads, Real-time: as Station.
class InstructorStation : public haptic::Station {
 public:
  /// Fails with a sentence when the device is unknown or cannot be opened.
  static Result<std::unique_ptr<InstructorStation>> open(const InstructorOptions& options);
  ~InstructorStation() override;

  [[nodiscard]] std::vector<std::string> handNames() const override;
  [[nodiscard]] Role role() const override { return Role::kInstructor; }
  void step(std::uint32_t seq) noexcept override;
  /// What the simulated instructor does, in a word or two: for progress output and tests.
  [[nodiscard]] const char* activity() const noexcept;

 protected:
  void begin(std::span<const HandId> hand_ids) override;
  void manifoldReceived(const HandManifold& manifold) noexcept override;
  void stepChanged() override;
  void armingChanged() noexcept override;

 private:
  struct Parts;
  explicit InstructorStation(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace tenon::instructor
