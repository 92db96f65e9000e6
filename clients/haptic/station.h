#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "clients/haptic/world_view.h"
#include "idl/types/fixed_vector.h"
#include "idl/types/messages.h"

namespace tenon {

class HapticHand;

inline constexpr std::size_t kMaxStationHands = 4;

enum class StationEventKind : std::uint8_t {
  kSafetyBegan,  ///< detail: the bit of a SafetyRule; value: [N] wanted; count: earlier ones not told
  kSafetyEnded,  ///< detail: likewise; value: [s] it acted
  kDeviceFault,  ///< detail: DeviceFault
  kIndexingBegan,
  kIndexingEnded,
  kBeyondValidity,  ///< the local model had to guess; value: ticks so far
  kStale,           ///< the manifold is older than may be used; value: its age in ticks
  kServerChanged,   ///< frames of a newer life of the server came
  kStopChanged,     ///< detail: 1 when an emergency stop was engaged, 0 when it was released
};

/// Something a person or a log should know of: plain data, so that the 1 kHz loop may write it.
struct StationEvent {
  std::uint32_t seq = 0;
  StationEventKind kind = StationEventKind::kSafetyBegan;
  HandId hand;
  std::uint32_t detail = 0;
  double value = 0.0;
  std::uint32_t count = 0;
};

/// A sentence for the log; `hand` is the name of the event's hand.
[[nodiscard]] std::string describe(const StationEvent& event, const std::string& hand);

/// What one person's station does each millisecond, whoever carries the messages.
///
/// Knows neither threads nor network: a program feeds it what came in, calls step() and sends what inputs()
/// and states() hold, be it over DDS in real time, tick-locked, or in one process on a virtual clock. With
/// equal messages and seeds it does the same to the last bit.
///
/// Threads: one. Real-time: receive of WorldFrame and HandManifold, step.
class Station {
 public:
  Station() = default;
  virtual ~Station() = default;
  Station(const Station&) = delete;
  Station& operator=(const Station&) = delete;

  /// Asked for at join.
  [[nodiscard]] virtual std::vector<std::string> handNames() const = 0;
  [[nodiscard]] virtual Role role() const = 0;

  /// Before the first step. `welcome.hands` are in the order of handNames(); a hand the scenario does not
  /// have has an invalid id there and is left out from then on.
  void welcome(const Welcome& welcome, std::span<const SceneObject> objects);

  void receive(const WorldFrame& frame) noexcept;
  void receive(const HandManifold& manifold) noexcept;
  void receive(const StepState& step);
  void receive(const EmergencyStop& stop);
  void receive(const GrabState& grab);

  /// One millisecond: devices, people, local model.
  virtual void step(std::uint32_t seq) noexcept = 0;

  [[nodiscard]] std::span<const DeviceInput> inputs() const { return {inputs_.begin(), inputs_.size()}; }
  [[nodiscard]] std::span<const HandState> states() const { return {states_.begin(), states_.size()}; }
  /// A sentence for the log.
  [[nodiscard]] std::string describe(const StationEvent& event) const;
  /// The hands the server gave this station, without those left out.
  [[nodiscard]] std::span<const HandId> hands() const { return {own_hands_.begin(), own_hands_.size()}; }

  /// Takes the oldest event not taken yet; false when there is none. When nobody takes them the oldest are
  /// lost.
  bool takeEvent(StationEvent& event) noexcept;

  [[nodiscard]] const WorldView& world() const { return world_; }
  [[nodiscard]] const StepState& currentStep() const { return step_; }

 protected:
  /// Called by welcome(): hand_ids[i] is of handNames()[i].
  virtual void begin(std::span<const HandId> hand_ids) = 0;
  virtual void heard(const HandManifold& manifold) noexcept = 0;
  virtual void stepChanged() {}
  virtual void stopChanged(bool engaged) = 0;

  /// What changed for a hand in the last millisecond.
  void report(const HapticHand& hand) noexcept;
  void report(StationEventKind kind, HandId hand, std::uint32_t detail, double value,
              std::uint32_t count = 0) noexcept;
  [[nodiscard]] const SceneObject* sceneObject(ObjectId object) const;
  [[nodiscard]] const std::vector<SceneObject>& sceneObjects() const { return objects_; }

  WorldView world_;
  ClientId client_;
  std::uint32_t seq_ = 0;
  FixedVector<DeviceInput, kMaxStationHands> inputs_;
  FixedVector<HandState, kMaxStationHands> states_;

 private:
  static constexpr std::size_t kEventRoom = 256;
  std::vector<SceneObject> objects_;
  StepState step_;
  FixedVector<HandId, kMaxStationHands> own_hands_;
  std::vector<HandId> hand_ids_;  ///< in the order of handNames()
  std::array<StationEvent, kEventRoom> events_{};
  std::uint64_t events_written_ = 0;
  std::uint64_t events_taken_ = 0;
};

}  // namespace tenon
