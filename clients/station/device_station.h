#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "clients/haptic/mover.h"
#include "clients/haptic/station.h"
#include "clients/haptic/tactile_map.h"
#include "clients/simulated_person/person.h"
#include "clients/station/script_mover.h"
#include "clients/station/station_arms.h"
#include "devices/catalog.h"
#include "idl/types/result.h"

namespace tenon::station {

/// Who moves the devices of a station.
enum class PersonKind {
  kSimulated,
  kScript,  ///< arms follow files
  kNone,    ///< who holds the devices
};

/// A station: hands x devices x trackers, and who moves it.
struct StationOptions {
  Role role = Role::kTrainee;
  std::vector<StationDevice> devices;  ///< in the order of their hands
  /// Names in the scenario, one for each arm of the devices (of two arms the right one first); empty: the
  /// role's, see defaultHands().
  std::vector<std::string> hands;
  std::string tracker;  ///< of the person's forearm and head; empty: none
  std::string tactors;  ///< bracelet on the tracked forearm; empty: none
  haptic::TactileMode tactile = haptic::TactileMode::kIntensity;
  PersonKind kind = PersonKind::kSimulated;
  simulated_person::PersonOptions person;  ///< of a simulated one
  std::vector<HandScript> scripts;         ///< of kScript
};

/// What a role has unless told otherwise: a trainee HUG's two arms, a bracelet and a tracker; an instructor
/// one arm of a sigma.7. A simulated person moves it.
[[nodiscard]] StationOptions defaultStation(Role role, const simulated_person::PersonOptions& person = {});
/// `right` and `left` of a trainee, `instructor` and `instructor_left` of an instructor.
[[nodiscard]] std::vector<std::string> defaultHands(Role role, std::size_t arms);

/// The station of one person: each arm of its devices moves a hand, a tracker its forearm and head.
///
/// Threads, Real-time: as Station.
class DeviceStation : public haptic::Station {
 public:
  /// Fails with a sentence when a device is unknown or cannot be opened, or when hands and arms do not fit.
  static Result<std::unique_ptr<DeviceStation>> open(const StationOptions& options);
  ~DeviceStation() override;

  [[nodiscard]] std::vector<std::string> handNames() const override;
  [[nodiscard]] std::vector<HandStiffness> stiffness() const override;
  [[nodiscard]] Role role() const override;
  [[nodiscard]] bool hasArmingButton() const override;
  [[nodiscard]] bool pressesItself() const override;
  [[nodiscard]] std::vector<haptic::HandDevice> handDevices() const override;
  /// The first device that does.
  [[nodiscard]] std::string pacedBy() const override;
  [[nodiscard]] bool awaitReading(std::chrono::nanoseconds longest) noexcept override;
  void step(std::uint32_t seq) noexcept override;
  void setCopies(haptic::SceneCopies&& copies) override;
  void setForceModel(haptic::ForceModelKind kind) noexcept override;
  [[nodiscard]] haptic::ForceModelKind forceModel() const noexcept override;
  using haptic::Station::receive;
  void receive(const CollisionMatrix& matrix) noexcept override;
  [[nodiscard]] bool wantsArming() const noexcept override;
  [[nodiscard]] Result<void> armDevices() override;
  void finish(bool disarms) noexcept override;
  [[nodiscard]] bool finished() const noexcept override;
  void end() noexcept override;
  /// What the mover does, in a word or two: for progress output and tests.
  [[nodiscard]] const char* activity() const noexcept;

 protected:
  void begin(std::span<const HandId> hand_ids) override;
  void manifoldReceived(const HandManifold& manifold) noexcept override;
  void guidanceReceived(const Guidance& guidance) noexcept override;
  void stepChanged() override;
  void armingChanged() noexcept override;

 private:
  struct Parts;
  explicit DeviceStation(std::unique_ptr<Parts> parts);
  [[nodiscard]] Result<void> openDevices();
  void makeMover();
  /// The hand of arm `index`, at its place in the scene.
  void beginHand(std::size_t index, HandId id);
  /// Presses when a simulated person would, or a device's own button says so.
  void pressButtons() noexcept;
  void moveArms() noexcept;
  /// The hand by which the person stands; null: there is none.
  [[nodiscard]] const haptic::HapticHand* firstHand() const noexcept;
  std::unique_ptr<Parts> parts_;
};

}  // namespace tenon::station
