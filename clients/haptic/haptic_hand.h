#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "clients/haptic/answer_age.h"
#include "clients/haptic/coupling.h"
#include "clients/haptic/device_handover.h"
#include "clients/haptic/force_model.h"
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
  bool beyond_validity_began = false;
  bool guidance_began = false;
  bool guidance_ended = false;
};

/// Haptic loop of one hand at 1 kHz: read device, indexing, force model, virtual coupling, safety layer,
/// write device; then what the force model computes for the next cycle. Also composes the messages to the
/// server (input) and to the other participants (state).
///
/// Every force passes the safety layer (devices/safety.h), that of a virtual fixture together with that of
/// the contacts, and only while these are rendered.
///
/// A force that was interrupted returns from zero: after a gap (the contacts are older than the layer's fresh
/// limit), a freeze, a refusal, a jump of a body, an arming or a stop. First the hand is re-anchored: the
/// workspace shifts until hand and server's proxy coincide, which the server has to answer; then the soft
/// start of the layer ramps the force. So no stretch of position that came about while nobody looked is
/// displayed, and nothing in the scene jumps; one of rotation stays, and its torque ramps.
///
/// While the person holds a button that de-clutches (DeviceCaps::declutch) the hand keeps its place in the
/// scene and the device moves alone, without force; its release ends a gap.
///
/// Threads: one; armDevice and setScene by others, beside it. Real-time: step, receive, permitForces.
class HapticHand {
 public:
  /// Parameters of workspace and coupling come from the device's capabilities. `device` and `clutch` outlive
  /// the hand; `clutch` is shared by the arms of a bimanual device, null for a single device.
  explicit HapticHand(devices::HapticDevice& device, devices::ClutchLatch* clutch = nullptr);

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
  HapticHand(const HapticHand&) = delete;
  HapticHand& operator=(const HapticHand&) = delete;

  /// The compiled scene of the server, for the force model `scene copy`: once. Allocates; by any thread,
  /// beside step().
  void setScene(const std::shared_ptr<const simulation::Scene>& scene) {
    if (scene) delete offered_.exchange(std::make_unique<SceneCopy>(scene).release());
  }
  /// From the next cycles on; `manifold` at first. A copy of the scene is used as far as there is one, and
  /// once it has contacts. Forces of the two are blended (SwitchSlew).
  void setForceModel(ForceModelKind kind) noexcept { wanted_model_ = kind; }
  /// That the force is of now.
  [[nodiscard]] ForceModelKind forceModel() const noexcept { return model_kind_; }
  /// [ticks] ForceModel::beyondValidity() of that one.
  [[nodiscard]] std::uint64_t beyondValidity() const noexcept { return beyond_count_; }
  /// `jitter` [s]: AnswerAge::setJitter.
  void setLinkJitter(double jitter) noexcept { answers_.setJitter(jitter); }
  /// ServerTime::setRoundTrip, `round_trip` [s].
  void setLinkRoundTrip(double round_trip) noexcept { time_.setRoundTrip(round_trip); }
  /// False: forces off, brake on, input inactive. True, for the person at the device, also of a device in
  /// fault: resets the safety layer, and asks for armDevice() if the device is not armed. See Arming, which
  /// decides it.
  void permitForces(bool permitted) noexcept;
  /// Whether begin() or permitForces() asked for armDevice().
  [[nodiscard]] bool wantsArming() const noexcept { return handover_.pending(); }
  /// Does what was asked for, resets and arms the device; may block. The loop has the device again
  /// after handBack(), which follows armDevice() of all hands that share its clutch.
  Result<void> armDevice() { return handover_.serve(device_); }
  void handBack() noexcept { handover_.handBack(); }
  /// With the next steps the force falls to zero, within kFinishTime; then the device displays none, and with
  /// `disarms` it is disarmed. Nothing ends that but a new begin().
  void finish(bool disarms) noexcept;
  [[nodiscard]] bool finished() const noexcept { return finishing_ && finish_time_ >= kFinishTime; }
  /// Forces off.
  void end() noexcept { device_.disarm(); }

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
  /// [s] age of the contacts that are rendered, on the clock of step(); infinite without any.
  [[nodiscard]] double contactAge() const noexcept { return answers_.age(); }

 private:
  static constexpr double kFinishTime = 0.025;  ///< [s] the safety layer takes 20 ms
  /// How the hand's force stands to its contacts.
  enum class Rendering {
    kInterrupted,  ///< they are not to be rendered, or not yet
    kAnchoring,    ///< the server has not yet answered the re-anchored hand
    kOn,
  };
  void readDevice() noexcept;
  /// `dt` [s].
  void moveWorkspace(double dt) noexcept;
  /// Decides rendering_ before the models' step, and re-anchors the hand.
  void anchor(std::uint32_t seq, const WorldView& world) noexcept;
  void stepModels(const Pose& X_WH, const WorldView& world) noexcept;
  /// What setScene() made; a first one only, since to free another would take time.
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
  [[nodiscard]] bool deadManHeld() const noexcept;
  void keepSample(std::uint32_t seq) noexcept;
  void updateOutputs(std::uint32_t seq, const WorldView& world, const Twist& V_WH) noexcept;
  void updateEvents() noexcept;

  devices::HapticDevice& device_;
  Workspace workspace_;
  LocalModel local_;  ///< has the server's newest manifold, whichever model the force is of
  ServerTime time_;
  std::unique_ptr<SceneCopy> copy_;
  std::atomic<SceneCopy*> offered_{nullptr};  ///< owned, until the loop takes it
  Coupling coupling_;
  SwitchSlew switch_slew_;
  VirtualFixture fixture_;
  devices::Safety safety_;
  AnswerAge answers_;
  DeviceHandover handover_;
  Rendering rendering_ = Rendering::kInterrupted;
  std::uint32_t anchored_seq_ = 0;  // first input of the re-anchored hand
  devices::DeviceState device_state_;
  DeviceInput input_;
  HandState state_;
  HandEvents events_;
  ForceModelKind wanted_model_ = ForceModelKind::kManifold;
  ForceModelKind model_kind_ = ForceModelKind::kManifold;
  std::uint64_t beyond_count_ = 0;  // of ForceModel::beyondValidity() at the last step
  bool fault_ = false;
  bool beyond_validity_ = false;
  bool stale_ = false;
  bool in_contact_ = false;
  bool guided_ = false;
  bool declutched_ = false;
  bool permitted_ = true;
  bool finishing_ = false;
  bool finish_disarms_ = false;
  double finish_time_ = 0.0;  // [s] since finish()
};

}  // namespace tenon::haptic
