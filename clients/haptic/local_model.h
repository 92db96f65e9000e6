#pragma once

#include <cstdint>

#include "clients/haptic/force_model.h"
#include "clients/haptic/world_view.h"
#include "idl/types/messages/contacts.h"
#include "server/collision/motion_solver.h"

namespace tenon::haptic {

/// The force model `manifold` of one hand: haptic rendering at 1 kHz between two manifolds of the server
/// (ARCHITECTURE.md).
///
/// The manifold lists contact half-spaces fixed in the other bodies. Each step places them where these bodies
/// are expected now, by their last received poses and velocities, and moves the hand's object as near to the
/// device pose as they permit: the server's problem for one body and planes only. So the force follows the
/// present device pose without network delay, and no force received over the network is displayed. The
/// solution depends on planes and device pose, not on the path, so it does not drift from the server's.
///
/// The springs of other hands on the same object act here too, so that both people feel each other. Between
/// two manifolds their goals move with the velocities that were told, within kLongestExpectation; where the
/// next one, after a gap, has a goal elsewhere, the force changes by kGoalForceStep a cycle at most. A hand
/// that is listed anew, or no more, gets or loses its stiffness within 20 ticks.
///
/// Threads: one. Real-time: everything but the constructor.
class LocalModel final : public ForceModel {
 public:
  LocalModel();

  /// Keeps the newest manifold; older ticks, older server epochs and non-finite poses are ignored.
  void receive(const HandManifold& manifold) noexcept;
  /// Whether the manifold can be rendered: it has an object, which is not held still, and none of its bodies
  /// has jumped since.
  [[nodiscard]] bool usable(const WorldView& world) const noexcept;
  /// The newest manifold is not a continuation of the one before: another object, or a jump of a body.
  [[nodiscard]] bool jumped() const noexcept override { return jumped_; }
  /// [s] Longest extrapolation of other bodies; longer ones oscillate on long links.
  static constexpr double kLongestExpectation = 0.02;
  static constexpr double kFarthestExpectation =
      0.002;  ///< [m] by which a contact's plane is off if it stops
  /// The next steps are those of `tick` [ticks] of the server: other bodies are expected where their velocity
  /// brings them by then, within kLongestExpectation and kFarthestExpectation (idl/types/motion_law.h). 0:
  /// where they were heard.
  void expectAt(double tick) noexcept { now_ = tick; }
  static constexpr double kGoalForceStep = 0.2;    ///< [N] a cycle
  static constexpr double kGoalTorqueStep = 0.02;  ///< [Nm] likewise
  /// The next step begins at the server's proxy.
  void restart() noexcept { jumped_ = true; }
  /// Server's proxy pose of the hand. Precondition: hasManifold().
  [[nodiscard]] Pose serverProxy() const noexcept { return manifold_.X_WO * manifold_.X_HO.inverse(); }
  /// One cycle with the device at X_WH.
  const LocalProxy& step(const Pose& X_WH, const WorldView& world) noexcept override;

  [[nodiscard]] const HandManifold& manifold() const noexcept { return manifold_; }
  [[nodiscard]] bool hasManifold() const noexcept { return has_manifold_; }
  [[nodiscard]] const LocalProxy& proxy() const noexcept override { return proxy_; }
  /// [ticks] so far ahead of the contact set: the object had left the region for which the manifold lists all
  /// contacts. Manifolds do not tell its size: its points are taken to be within 0.1 m of its origin.
  [[nodiscard]] std::uint64_t beyondValidity() const noexcept override { return beyond_validity_; }

 private:
  /// Spring of another hand on the same object.
  struct OtherHandSpring {
    HandPull pull;
    Pose X_WG;            ///< goal in force
    Displacement offset;  ///< from the goal that was told to the one in force
    double weight = 1.0;  ///< [-] of its stiffness; falls to 0 after the manifold no longer lists it
    bool listed = true;
  };
  /// `after_gap`: the manifolds of ticks before it did not come.
  void updateOtherSprings(bool same_object, bool after_gap) noexcept;
  void moveOtherSprings() noexcept;
  [[nodiscard]] bool isElsewhere(const ManifoldContact& contact, const WorldView& world) const noexcept;
  [[nodiscard]] bool outdated(const WorldView& world) const noexcept;
  void solve(const Pose& X_WH, const WorldView& world) noexcept;
  void updateValidityCount() noexcept;

  collision::MotionSolver solver_;
  HandManifold manifold_;
  LocalProxy proxy_;
  collision::MovableBody body_;
  FixedVector<OtherHandSpring, 2 * kOtherPulls> other_springs_;
  FixedVector<collision::ContactConstraint, kManifoldContacts> constraints_;
  std::array<double, kManifoldContacts> multipliers_{};  ///< [N] of each constraint
  std::uint64_t beyond_validity_ = 0;
  Tick stepped_tick_ = 0;      ///< of the manifold at the last step
  double now_ = 0.0;           ///< [ticks] of the server
  double manifold_age_ = 0.0;  ///< [s] since it was received
  bool has_manifold_ = false;
  bool jumped_ = false;
  bool late_ = false;  ///< manifolds since the last step have followed a gap
};

}  // namespace tenon::haptic
