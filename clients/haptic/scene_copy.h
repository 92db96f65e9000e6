#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "clients/haptic/force_model.h"
#include "clients/haptic/local_model.h"
#include "clients/haptic/predicted_body.h"
#include "clients/haptic/server_time.h"
#include "clients/haptic/world_view.h"
#include "idl/types/messages/contacts.h"
#include "server/simulation/environment.h"
#include "server/simulation/scene.h"

namespace tenon::haptic {

/// The force model `scene copy` of one hand: the server's own simulation, run at the station for this hand's
/// object alone. So contacts are as young as on the server's machine, whatever the link does; the server
/// stays the authority on where everything is.
///
/// Each cycle the copy moves the hand's object by the present pose of the device against all others, and
/// lists its contacts as the server does; the next cycle renders them by a LocalModel, as it would render the
/// server's.
///
/// * Free bodies are simulated here too, and kept where the server has them for the same input: see
///   PredictedBody.
/// * What others move is where it was last heard, extrapolated with its heard velocity to the tick that the
///   server would compute now (idl/types/motion_law.h, ServerTime), unless it moves slowly. A newer frame
///   shifts it by at most kLargestCorrection a cycle beside its own motion: so much of a reversal is felt a
///   millisecond.
/// * Couplings of other hands on the object, and contributions of other sources, act as the server's manifold
///   tells them; goals of hands are extrapolated likewise, slow ones only since the manifold came: so they
///   do not move in steps, and two people on one part do not swing.
/// * An object that another hand holds close by is simulated with that hand's coupling, whose goal is
///   extrapolated likewise, so it yields without the round-trip delay.
/// * A hand that the manifold lists no more, since it is frozen, keeps its object as in the server: without a
///   pull, and without a jump when its inputs resume. One whose object moves nevertheless is out of reach,
///   and its grasp ends. A pull on the hand's own object fades out and in within kPullFade; one on another
///   object reaches the listed stiffness within kPullFade.
/// * The object starts at the server's proxy, and again after each of its jumps. On a scene at rest both then
///   solve one problem for one device pose. Where the answer to a pose nevertheless stays away from what the
///   copy had for that pose, with all at rest, the copy has jumped(): the hand is re-anchored at the
///   server's.
///
/// Threads: one. Real-time: everything but the constructor.
class SceneCopy final : public ForceModel {
 public:
  explicit SceneCopy(std::shared_ptr<const simulation::Scene> scene);
  ~SceneCopy() override;

  /// The contacts of the next cycle: the device read as input `seq` at X_WH, and `heard`, the newest manifold
  /// of the server, as `time` has received it. Not `rendered`: the hand's force is interrupted, and the copy
  /// waits.
  void compute(const HandManifold& heard, std::uint32_t seq, const ServerTime& time, const Pose& X_WH,
               const Twist& V_WH, const WorldView& world, bool rendered) noexcept;
  /// Whether it has contacts for the next cycle.
  [[nodiscard]] bool ready() const noexcept { return following_; }
  /// Which pairs collide; until then those of the scene's start.
  void receive(const CollisionMatrix& matrix) noexcept;

  const LocalProxy& step(const Pose& X_WH, const WorldView& world) noexcept override;
  [[nodiscard]] const LocalProxy& proxy() const noexcept override { return model_.proxy(); }
  [[nodiscard]] bool jumped() const noexcept override { return model_.jumped() || diverged_; }
  [[nodiscard]] std::uint64_t beyondValidity() const noexcept override { return model_.beyondValidity(); }
  [[nodiscard]] const simulation::Environment& environment() const noexcept { return environment_; }

  static constexpr double kLargestCorrection = 1e-3;  ///< [m] of any point of a body, in a cycle
  /// [s] Of heard velocities, which are those of single ticks: smooths the resolution of another hand's
  /// encoders, and adds its time to the delay where motion changes. Of frames that are farther apart the
  /// mean velocities between their poses are taken, on a straight line to the time of the newest one.
  static constexpr double kTwistFilter = 0.005;
  /// [s] Of frames that are farther apart than that the mean velocity is too old.
  static constexpr double kLongestFrame = 0.03;
  static constexpr double kPullFade = 0.02;  ///< [s] in which pulls of other hands begin and end

 private:
  /// What was heard of an object, as the copy has it.
  struct Mirrored {
    bool known = false;
    std::uint32_t epoch = 0;
    ObjectStatus status = ObjectStatus::kHidden;
    Tick updated_at = 0;
    Twist V_WO;                          ///< at updated_at, filtered
    Pose X_WO;                           ///< heard last
    Twist mean_V_WO;                     ///< between the last two poses
    std::optional<double> mean_seconds;  ///< [s] between them
    Tick compared_at = 0;                ///< of a free body
  };
  /// Another hand that has an object in the copy, its own or that of this hand.
  struct OtherHand {
    ObjectId object;          ///< invalid: none
    Pose X_WG;                ///< goal of the object in the copy
    Pose X_WO_begun;          ///< where it was when the hand began to pull it, or heard when it ceased
    HandStiffness stiffness;  ///< that was listed last
    double weight = 0.0;      ///< [-] of its coupling beside the listed one; 0: frozen
  };
  /// Which input the manifold of a tick answered.
  struct Answered {
    Tick tick = 0;
    std::uint32_t seq = 0;
    bool is_comparable = false;
  };
  struct PastProxy {
    std::uint32_t seq = 0;
    Pose X_WO;
  };

  void hear(const HandManifold& heard) noexcept;
  void takeHold(const HandManifold& heard) noexcept;
  void enablePairs(std::size_t first, std::size_t end) noexcept;
  /// `now` [ticks] of the server.
  void mirrorObjects(const WorldView& world, const HandManifold& heard, double now) noexcept;
  /// `now` [ticks] of the server.
  void predict(ObjectId object, const ObservedObject& seen, double now) noexcept;
  void compareBody(PredictedBody& body, Mirrored& mirrored, const ObservedObject& seen) noexcept;
  /// Null: the object has no mass.
  [[nodiscard]] PredictedBody* bodyOf(ObjectId object) noexcept;
  /// `now` [ticks] of the server.
  void mirror(ObjectId object, const ObservedObject& seen, double now) noexcept;
  static void hearMotion(Mirrored& mirrored, const ObservedObject& seen) noexcept;
  /// `now` [ticks] of the server.
  void mirrorOtherHands(const WorldView& world, const HandManifold& heard, double now) noexcept;
  /// The hand pulls no more: it is frozen, has released its object, or is out of reach.
  void fadePull(HandId hand, const WorldView& world) noexcept;
  [[nodiscard]] bool hasLeft(const OtherHand& other, const ObservedObject& seen) const noexcept;
  void endGrasp(HandId hand) noexcept;
  /// The hand pulls its object, by what was heard `ahead` [s] before the present tick.
  void mirrorPull(const HandPull& pull, double ahead) noexcept;
  void grasp(const HandPull& pull, const Pose& X_WG) noexcept;
  void contribute(const HandPull& pull) noexcept;
  /// The coupling has its weight of the one that was listed.
  void applyWeight(HandId hand) noexcept;
  [[nodiscard]] bool isNeighbours(ObjectId object) const noexcept;
  void setStiffness(HandId hand, const HandStiffness& stiffness) noexcept;
  void listContacts(const HandManifold& heard, std::uint32_t seq) noexcept;
  void compareWithServer(const HandManifold& heard, std::uint32_t seq) noexcept;

  simulation::Environment environment_;
  LocalModel model_;
  WorldView view_;  ///< poses in the copy
  std::vector<Mirrored> mirrored_;
  std::vector<PredictedBody> bodies_;
  std::vector<std::uint32_t> body_of_;    ///< by object: index into bodies_, or their number
  std::vector<HandStiffness> stiffness_;  ///< by hand: that the copy has
  std::vector<OtherHand> others_;         ///< by hand
  std::vector<bool> collides_;            ///< by pair: in the server
  HandManifold contacts_;
  Tick heard_tick_ = 0;
  double heard_age_ = 0.0;              ///< [s] since then
  std::int64_t behind_ = 0;             ///< [ticks] the heard tick less the input that it used
  std::array<Answered, 8> answered_{};  ///< by the last manifolds
  std::size_t answers_ = 0;             ///< so far
  std::uint32_t heard_epoch_ = 0;
  HandId hand_;
  ObjectId object_;
  std::uint32_t object_epoch_ = 0;
  std::array<PastProxy, 1024> past_{};  ///< by seq modulo its size
  std::uint32_t apart_ = 0;             ///< [cycles] the server's proxy has been elsewhere
  bool following_ = false;
  bool diverged_ = false;
};

/// `count` copies, one for each hand of a station. Threads: any. Real-time: no.
[[nodiscard]] std::vector<std::unique_ptr<SceneCopy>> copiesOf(
    const std::shared_ptr<const simulation::Scene>& scene, std::size_t count);

}  // namespace tenon::haptic
