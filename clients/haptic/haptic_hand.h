#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>

#include "clients/haptic/answer_age.h"
#include "clients/haptic/coupling.h"
#include "clients/haptic/force_model.h"
#include "clients/haptic/gap_backoff.h"
#include "clients/haptic/guarded_device.h"
#include "clients/haptic/local_model.h"
#include "clients/haptic/scene_copy.h"
#include "clients/haptic/switch_slew.h"
#include "clients/haptic/virtual_fixture.h"
#include "clients/haptic/workspace.h"
#include "devices/device.h"
#include "devices/safety.h"
#include "idl/types/fixed_vector.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/hands.h"

namespace tenon::haptic {

/// Stiffness that a device renders passively at its rate, delay and damping: Join::stiffness.
[[nodiscard]] HandStiffness stiffnessOf(const devices::DeviceCaps& caps) noexcept;

/// State changes of a hand within one millisecond, for the event log.
struct HandEvents {
  FixedVector<devices::Intervention, 8> interventions;  ///< begins and ends of safety rules
  bool fault_began = false;
  bool indexing_began = false;
  bool indexing_ended = false;
  bool stale_began = false;
  bool guidance_alone_began = false;  ///< the link is too long for contacts (AnswerAge::isTooLong)
  bool guidance_alone_ended = false;
  bool beyond_validity_began = false;
  bool guidance_began = false;
  bool guidance_ended = false;
};

/// Haptic loop of one hand at 1 kHz: read device, indexing, force model, virtual coupling, safety layer,
/// write device; then what the force model computes for the next cycle. Also composes the messages to the
/// server (input) and to the other participants (state).
///
/// Every force passes the safety layer (devices/safety.h), that of a virtual fixture together with that of
/// the contacts, and only while these are rendered; or alone, over a link that is too long for contacts
/// (AnswerAge::isTooLong), since it needs no answer of the server: the age of its messages is its own bound.
///
/// A force that was interrupted returns from zero: after a gap (the contacts are older than the layer's fresh
/// limit), a freeze, a refusal, a jump of a body, an arming or a stop. First the hand is re-anchored: the
/// workspace shifts until hand and server's proxy coincide, which the server has to answer; then the soft
/// start of the layer ramps the force. So nothing in the scene jumps, and no translational coupling error
/// accumulated in the gap is rendered; a rotational error remains and its torque is ramped. After gaps in
/// quick succession it waits (GapBackoff).
///
/// A device whose readings stop, and which says nothing, ages like contacts: the force fades with the age of
/// the last reading, and from SafetyLimits::stale_at on it has lost its communication, a fault until its
/// person presses.
///
/// While the person holds a button that de-clutches (DeviceCaps::declutch) the hand keeps its place in the
/// scene and the device moves alone, without force; its release ends a gap.
///
/// Threads: as GuardedDevice; setCopy by another one, beside it. Real-time: step, receive, permitForces, and
/// as GuardedDevice.
class HapticHand : public GuardedDevice {
 public:
  /// Parameters of workspace and coupling come from the device's capabilities. `device` and `clutch` outlive
  /// the hand; `clutch` is shared by the arms of a bimanual device, null for a single device. `heat`: what
  /// the device's last hand left.
  explicit HapticHand(devices::HapticDevice& device, devices::ClutchLatch* clutch = nullptr,
                      const devices::MotorThermalModel& heat = {});

  /// Places the workspace so that the hand is at p_WH now. Not `armed`, the device is disarmed; else one that
  /// has no forces on is to be armed by armDevice(), unless it is in fault.
  void begin(HandId hand, ClientId client, const Vector3& p_WH, bool armed);
  void receive(const HandManifold& manifold) noexcept { local_.receive(manifold); }
  void receive(const Guidance& guidance) noexcept { fixture_.receive(guidance); }
  void receive(const CollisionMatrix& matrix) noexcept {
    takeScene();
    if (copy_) copy_->receive(matrix);
  }
  /// One cycle of `dt` [s], the time since the last one by the clock of the caller; `seq` numbers the input.
  void step(std::uint32_t seq, const WorldView& world, double dt) noexcept;
  ~HapticHand() { delete offered_.load(); }

  /// For the force model `scene copy`: once. By any thread, beside step().
  void setCopy(std::unique_ptr<SceneCopy> copy) { delete offered_.exchange(copy.release()); }
  /// From the next cycles on; `manifold` at first. A copy of the scene is used as far as there is one, and
  /// once it has contacts. Between the two the force changes as SwitchSlew says. In a gap the model that
  /// rendered continues from its last contacts.
  void setForceModel(ForceModelKind kind) noexcept { wanted_model_ = kind; }
  /// That the force is of now.
  [[nodiscard]] ForceModelKind forceModel() const noexcept { return model_kind_; }
  /// [ticks] ForceModel::beyondValidity() of that one.
  [[nodiscard]] std::uint64_t beyondValidity() const noexcept { return beyond_count_; }
  /// `jitter` [s]: AnswerAge::setJitter.
  void setLinkJitter(double jitter) noexcept { answers_.setJitter(jitter); }
  /// ServerTime::setRoundTrip, `round_trip` [s].
  void setLinkRoundTrip(double round_trip) noexcept { time_.setRoundTrip(round_trip); }
  /// False, a stop: forces off, brake on, input inactive. True, for the person at the device, also of one in
  /// fault: resets the safety layer, and asks for armDevice() if the device is not armed. See Arming, which
  /// decides it.
  void permitForces(bool permitted) noexcept;
  /// The force is zero: kFinishTime after finish().
  [[nodiscard]] bool finished() const noexcept { return finishing_ && finish_time_ >= kFinishTime; }

  [[nodiscard]] HandId id() const noexcept { return input_.hand; }
  [[nodiscard]] const DeviceInput& input() const noexcept { return input_; }
  [[nodiscard]] const HandState& state() const noexcept { return state_; }
  [[nodiscard]] const HandEvents& events() const noexcept { return events_; }
  [[nodiscard]] const devices::DeviceState& device() const noexcept { return device_state_; }
  [[nodiscard]] const devices::DeviceCaps& caps() const noexcept { return device_.caps(); }
  [[nodiscard]] Workspace& workspace() noexcept { return workspace_; }
  [[nodiscard]] const LocalModel& local() const noexcept { return local_; }
  [[nodiscard]] const VirtualFixture& fixture() const noexcept { return fixture_; }
  [[nodiscard]] const Pose& pose() const noexcept { return input_.sample.X_WH; }
  [[nodiscard]] bool inContact() const noexcept { return in_contact_; }
  /// Forces are permitted, but a fault of the device or an open clutch keeps them off until the person
  /// presses.
  [[nodiscard]] bool faulty() const noexcept {
    const bool off = device_state_.fault != devices::DeviceFault::kNone || safety_.wantsDisarm();
    return permitted_ && off && !handover_.pending();
  }
  [[nodiscard]] const devices::MotorThermalModel& heat() const noexcept { return safety_.heat(); }
  /// [s] age of the contacts that are rendered, on the clock of step(); infinite without any.
  [[nodiscard]] double contactAge() const noexcept { return answers_.age(); }
  /// [s] of the link, one way: half of AnswerAge::delay().
  [[nodiscard]] double linkDelay() const noexcept { return 0.5 * answers_.delay(); }

 private:
  static constexpr double kFinishTime = 0.025;  ///< [s] the safety layer takes 20 ms
  /// Rendering state of the contacts.
  enum class Rendering {
    kInterrupted,  ///< they are not to be rendered, or not yet
    kAnchoring,    ///< the server has not yet answered the re-anchored hand
    kOn,
    kGuidanceAlone,  ///< the link is too long for them; a virtual fixture is displayed
  };
  /// `dt` [s].
  void readDevice(double dt) noexcept;
  /// A fault of a device that has not had a new reading for too long. `dt` [s].
  void checkReading(std::uint64_t seq_before, double dt) noexcept;
  /// `dt` [s].
  void moveWorkspace(double dt) noexcept;
  /// Decides rendering_ before the models' step, and re-anchors the hand.
  void anchor(std::uint32_t seq, const WorldView& world) noexcept;
  void stepModels(const Pose& X_WH, const WorldView& world) noexcept;
  /// The force is of the copy in this cycle. After the local model's step.
  [[nodiscard]] bool rendersCopy() const noexcept;
  /// What setCopy() was given; a first one only, since to free another would take time.
  void takeScene() noexcept {
    if (!copy_ && offered_.load(std::memory_order_relaxed) != nullptr)
      copy_.reset(offered_.exchange(nullptr));
  }
  [[nodiscard]] const ForceModel& model() const noexcept {
    if (model_kind_ == ForceModelKind::kSceneCopy) return *copy_;
    return local_;
  }
  /// `dt` [s].
  [[nodiscard]] devices::SafetyRequest request(const Pose& X_WH, double dt) noexcept;
  void writeDevice(const devices::DeviceCommand& command) noexcept;
  /// [s] of contacts, beyond what their link explains, or of the device's reading, whichever is older.
  [[nodiscard]] double excess() const noexcept { return std::max(answers_.excess(), reading_age_); }
  [[nodiscard]] bool deadManHeld() const noexcept;
  void keepSample(std::uint32_t seq) noexcept;
  void updateOutputs(std::uint32_t seq, const WorldView& world, const Twist& V_WH) noexcept;
  void updateEvents() noexcept;

  Workspace workspace_;
  LocalModel local_;  ///< has the server's newest manifold, whichever model the force is of
  ServerTime time_;
  std::unique_ptr<SceneCopy> copy_;
  std::atomic<SceneCopy*> offered_{nullptr};  ///< owned, until the loop takes it
  Coupling coupling_;
  SwitchSlew switch_slew_;
  VirtualFixture fixture_;
  AnswerAge answers_;
  GapBackoff backoff_;
  bool fresh_ = false;  // the contacts are no gap, and have been none for long enough
  Rendering rendering_ = Rendering::kInterrupted;
  std::uint32_t anchored_seq_ = 0;  // first input of the re-anchored hand
  devices::DeviceState device_state_;
  double reading_age_ = 0.0;    ///< [s] since there was a new one
  Twist V_DH_read_;             ///< of the newest one
  bool readings_lost_ = false;  ///< latched, until the person presses
  DeviceInput input_;
  HandState state_;
  HandEvents events_;
  ForceModelKind wanted_model_ = ForceModelKind::kManifold;
  ForceModelKind model_kind_ = ForceModelKind::kManifold;
  std::uint64_t beyond_count_ = 0;  // of ForceModel::beyondValidity() at the last step
  bool fault_ = false;
  bool beyond_validity_ = false;
  bool stale_ = false;
  bool guidance_alone_ = false;  // as told by events_
  bool in_contact_ = false;
  bool guided_ = false;
  bool declutched_ = false;
  bool stopped_ = false;      // permitForces() took the permission
  double finish_time_ = 0.0;  // [s] since finish()
};

}  // namespace tenon::haptic
