#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "clients/haptic/arming.h"
#include "clients/haptic/force_model.h"
#include "clients/haptic/world_view.h"
#include "devices/device.h"
#include "idl/types/fixed_vector.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/role.h"
#include "idl/types/messages/session.h"
#include "idl/types/messages/steps.h"
#include "idl/types/result.h"

namespace tenon::haptic {

class HapticHand;
class SceneCopy;
using SceneCopies = std::vector<std::unique_ptr<SceneCopy>>;

inline constexpr std::size_t kMaxStationHands = 4;

enum class StationEventKind : std::uint8_t {
  kSafetyBegan,  ///< detail: bit of a SafetyRule; value: [N] requested; count: unreported earlier ones
  kSafetyEnded,  ///< detail: likewise; value: [s] of activity
  kDeviceFault,  ///< detail: DeviceFault
  kIndexingBegan,
  kIndexingEnded,
  kBeyondValidity,  ///< the hand is ahead of the contact set; value: [ticks] in total so far
  kStale,           ///< the contacts are too old for full stiffness; value: [ticks] their age
  kServerChanged,   ///< frames of a newer server epoch arrived; detail: the epoch
  kStopChanged,     ///< detail: 1 when an emergency stop was engaged, 0 when it was released
  kArmed,           ///< the person has armed the devices
  kGuidanceBegan,   ///< a virtual fixture acts on the hand
  kGuidanceEnded,
  kGuidanceAlone,  ///< the link is too long for contacts; value: [ms] one way
  kContactsAgain,  ///< it is no more; value: likewise
};

/// Event for the log. Plain data, so that the 1 kHz loop can write it.
struct StationEvent {
  std::uint32_t seq = 0;  ///< step of the station
  StationEventKind kind = StationEventKind::kSafetyBegan;
  HandId hand;
  std::uint32_t detail = 0;
  double value = 0.0;       ///< [N], [s], [ms] or [ticks], see StationEventKind
  std::uint32_t count = 0;  ///< of safety: see above; else how many times, in one event; 0: once
  Tick tick = 0;            ///< newest one received when it happened
};

/// Text for the log; `hand` is the name of the event's hand.
[[nodiscard]] std::string describe(const StationEvent& event, const std::string& hand);

/// What moves a hand of a station.
struct HandDevice {
  std::string hand;               ///< its name
  std::string model;              ///< DeviceCaps::model
  std::string serial;             ///< DeviceCaps::serial
  double workspace_radius = 0.0;  ///< [m] what the device reaches about C_w (Workspace)
};

/// Text for the log.
[[nodiscard]] std::string describe(const HandDevice& device);

/// Haptic processing of one person's station: all devices, hands and, in simulation, the person.
///
/// Independent of threads and network: a program passes received messages to receive(), calls step() each
/// millisecond and sends inputs() and states(); over DDS in real time, in lockstep, or in one process on a
/// virtual clock. Deterministic: equal messages and seeds give bit-equal outputs.
///
/// Threads: one. Real-time: receive of WorldFrame, HandManifold, Guidance and CollisionMatrix,
/// awaitReading, step, setForceModel, finish.
class Station {
 public:
  Station() = default;
  virtual ~Station() = default;
  Station(const Station&) = delete;
  Station& operator=(const Station&) = delete;

  /// Hands requested at join.
  [[nodiscard]] virtual std::vector<std::string> handNames() const = 0;
  /// Join::stiffness, in the order of handNames().
  [[nodiscard]] virtual std::vector<HandStiffness> stiffness() const { return {}; }
  [[nodiscard]] virtual Role role() const = 0;
  /// A device has a button that arms.
  [[nodiscard]] virtual bool hasArmingButton() const { return false; }
  /// Who moves its devices presses without being asked: a simulated person, or a script.
  [[nodiscard]] virtual bool pressesItself() const { return false; }
  /// Of each hand that is moved by a device with a workspace.
  [[nodiscard]] virtual std::vector<HandDevice> handDevices() const { return {}; }

  /// Called before the first step and after a rejoin with a new seat. `welcome.hands` are in the order of
  /// handNames(); a hand that the scenario lacks has an invalid id and is skipped.
  void welcome(const Welcome& welcome, std::span<const SceneObject> objects);

  void receive(const WorldFrame& frame) noexcept;
  /// False, and nothing is done, when it is of a hand of another station.
  bool receive(const HandManifold& manifold) noexcept;
  /// Likewise.
  bool receive(const Guidance& guidance) noexcept;
  void receive(const StepState& step);
  /// For the force model `scene copy` of all hands.
  virtual void receive(const CollisionMatrix& /*matrix*/) noexcept {}
  void receive(const StopSignal& stop) noexcept;
  /// The person at this station arms it, or agrees that an emergency stop ends (Arming).
  void press() noexcept;
  [[nodiscard]] const Arming& arming() const noexcept { return arming_; }

  /// What paces the loop, for people, as "the device of hand right"; empty: no device of this station does.
  [[nodiscard]] virtual std::string pacedBy() const { return {}; }
  /// HapticDevice::awaitReading of the device that paces, for the next step; by the thread of step(). False
  /// at once while it is being armed.
  [[nodiscard]] virtual bool awaitReading(std::chrono::nanoseconds /*longest*/) noexcept { return false; }
  /// One cycle of devices, local models and simulated person; `seq` numbers the inputs.
  virtual void step(std::uint32_t seq) noexcept = 0;
  /// `dt` [s]: from the last step to the next one, by the clock of whoever calls step(); kTickSeconds unless
  /// told.
  void setCycle(double dt) noexcept { dt_ = dt; }
  /// `jitter` [s] of the link, as its contacts have it lately (AnswerAge::setJitter); 0 unless told.
  void setLinkJitter(double jitter) noexcept { link_jitter_ = jitter; }
  /// For the force model `scene copy`, one for each of handDevices(): a hand that has none takes one, now or
  /// in welcome(), where each hand begins without. By the thread of welcome(), also beside step().
  virtual void setCopies(SceneCopies&& /*copies*/) {}
  /// HapticHand::setForceModel of all hands.
  virtual void setForceModel(ForceModelKind /*kind*/) noexcept {}
  /// The one that was set; `manifold` at first.
  [[nodiscard]] virtual ForceModelKind forceModel() const noexcept { return ForceModelKind::kManifold; }
  /// Shortest `round_trip` [s] of the link (ServerTime::setRoundTrip); 0 unless told.
  void setLinkRoundTrip(double round_trip) noexcept { link_round_trip_ = round_trip; }
  /// Whether there is something for armDevices() to do.
  [[nodiscard]] virtual bool wantsArming() const noexcept { return false; }
  /// Resets and arms the devices, if the person has pressed for it. It may block and make texts, so it has a
  /// thread of its own beside that of step(), or is called between two steps. Fails with what a device says.
  [[nodiscard]] virtual Result<void> armDevices() = 0;
  /// With the next steps forces and vibrations fall to zero, within 25 ms; then nothing is displayed, and
  /// with `disarms` the devices are disarmed, until welcome().
  virtual void finish(bool /*disarms*/) noexcept {}
  /// All of finish() is done.
  [[nodiscard]] virtual bool finished() const noexcept { return true; }
  /// Disarms the devices at once.
  virtual void end() noexcept {}

  [[nodiscard]] std::span<const DeviceInput> inputs() const { return {inputs_.begin(), inputs_.size()}; }
  [[nodiscard]] std::span<const HandState> states() const { return {states_.begin(), states_.size()}; }
  /// Text for the log.
  [[nodiscard]] std::string describe(const StationEvent& event) const;
  /// This station's hands that exist in the session.
  [[nodiscard]] std::span<const HandId> hands() const { return {own_hands_.begin(), own_hands_.size()}; }

  /// Takes the oldest event; false when there is none. When kEventCapacity is exceeded the oldest are lost.
  bool takeEvent(StationEvent& event) noexcept;

  [[nodiscard]] const WorldView& world() const { return world_; }
  [[nodiscard]] const StepState& currentStep() const { return step_; }

 protected:
  /// Called by welcome(): hand_ids[i] belongs to handNames()[i].
  virtual void begin(std::span<const HandId> hand_ids) = 0;
  /// A manifold of one of this station's hands.
  virtual void manifoldReceived(const HandManifold& manifold) noexcept = 0;
  /// Of one of this station's hands.
  virtual void guidanceReceived(const Guidance& /*guidance*/) noexcept {}
  /// currentStep() is new.
  virtual void stepChanged() {}
  /// arming().permitsForces() is new, or the person has pressed again: a device in fault is to be reset.
  virtual void armingChanged() noexcept = 0;
  /// To be called once a step by a station with a simulated person: it presses half a second after it could,
  /// and two seconds after a device went into a fault, which it has looked at by then.
  void pressLikeAPerson(bool fault) noexcept;

  /// Queues the events of a hand's last step.
  void report(const HapticHand& hand) noexcept;
  /// Queues one event; `value` [unit: see StationEventKind].
  void report(StationEventKind kind, HandId hand, std::uint32_t detail, double value,
              std::uint32_t count = 0) noexcept;
  [[nodiscard]] const SceneObject* sceneObject(ObjectId object) const;
  [[nodiscard]] const std::vector<SceneObject>& sceneObjects() const { return objects_; }
  /// What the hand `index` of handNames() moves while it holds no part; invalid: nothing, or the hand is
  /// none of the scenario's.
  [[nodiscard]] ObjectId handObject(std::size_t index) const { return hand_objects_[index]; }

  WorldView world_;
  ClientId client_;
  std::uint32_t seq_ = 0;
  double dt_ = kTickSeconds;      ///< [s] see setCycle()
  double link_jitter_ = 0.0;      ///< [s]
  double link_round_trip_ = 0.0;  ///< [s]
  FixedVector<DeviceInput, kMaxStationHands> inputs_;
  FixedVector<HandState, kMaxStationHands> states_;

 private:
  void updateArming(bool permitted_before) noexcept;
  [[nodiscard]] bool isOwn(HandId hand) const noexcept;

  static constexpr std::size_t kEventCapacity = 256;
  Arming arming_;
  std::uint32_t unpressed_ = 0;  ///< [steps] since a press is awaited
  std::uint32_t faulty_ = 0;     ///< [steps] since a device is in fault
  std::vector<SceneObject> objects_;
  std::vector<ObjectId> hand_objects_;
  StepState step_;
  FixedVector<HandId, kMaxStationHands> own_hands_;
  std::vector<HandId> hand_ids_;  ///< in the order of handNames()
  std::array<StationEvent, kEventCapacity> events_{};
  std::uint64_t events_written_ = 0;
  std::uint64_t events_taken_ = 0;
};

}  // namespace tenon::haptic
