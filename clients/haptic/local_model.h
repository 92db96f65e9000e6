#pragma once

#include <cstdint>

#include "clients/haptic/world_view.h"
#include "idl/types/messages.h"
#include "server/collision/motion_solver.h"

namespace tenon {

/// How old a manifold may be, in ticks since it arrived. The defaults are those of a local network.
struct StalenessLimits {
  std::uint32_t fresh = 20;  ///< used as it is up to this age
  std::uint32_t gone = 100;  ///< stiffness has decayed to nothing at this age
};

/// What the local model says about one hand in one millisecond.
struct LocalProxy {
  bool active = false;  ///< there is a manifold to go by; else nothing is felt
  bool jumped = false;  ///< since the last step the object or its epoch changed: what was felt has to fade
  bool touching = false;
  Pose X_WO;               ///< the object, kept out of what it touches
  Pose X_WS;               ///< the hand, were it where the object lets it be: the spring's near end S
  double stiffness = 0.0;  ///< [N/m], after decay by age
  double rotational_stiffness = 0.0;  ///< [Nm/rad], likewise
  std::uint32_t age = 0;              ///< [ticks] of the manifold
};

/// The force model of one hand between two messages of the server (DESIGN §2, thin client).
///
/// The server's manifold lists half-spaces fixed in the other bodies; here they are put where those bodies
/// were last heard to be, and the hand's object is moved as near to the device as they allow: the same
/// problem the server solves, for one body and planes only. So what is felt answers the hand of this
/// millisecond, and no contact force that crossed the network is felt. The answer depends on planes and
/// device alone, not on the path, so it cannot drift from the server's.
///
/// Whoever else holds the object pulls at it here as well, from where he was last heard to be, so both feel
/// each other. When he lets go his pull fades within ticks: a part that two have bent between them comes
/// back no faster than at the server.
///
/// Threads: one. Real-time: everything but the constructor.
class LocalModel {
 public:
  explicit LocalModel(const StalenessLimits& limits = {});

  /// Keeps the newest; older ticks and older lives of the server are ignored.
  void receive(const HandManifold& manifold) noexcept;
  const LocalProxy& step(const Pose& X_WH, const WorldView& world) noexcept;

  [[nodiscard]] const HandManifold& manifold() const noexcept { return manifold_; }
  [[nodiscard]] bool heard() const noexcept { return heard_; }
  [[nodiscard]] const LocalProxy& proxy() const noexcept { return proxy_; }
  [[nodiscard]] const StalenessLimits& limits() const noexcept { return limits_; }
  /// Ticks in which the object had left the region for which the manifold lists every contact.
  [[nodiscard]] std::uint64_t beyondValidity() const noexcept { return beyond_validity_; }

 private:
  /// Another hand's pull, and how much of it is left once it is no longer listed.
  struct OtherPull {
    HandPull pull;
    double weight = 1.0;
    bool listed = true;
  };
  void receivePulls(bool same_object) noexcept;
  void fadePulls() noexcept;
  [[nodiscard]] bool outdated(const WorldView& world) const noexcept;
  [[nodiscard]] double freshness() const noexcept;
  void solve(const Pose& X_WH, const WorldView& world) noexcept;
  void countValidity() noexcept;

  StalenessLimits limits_;
  MotionSolver solver_;
  HandManifold manifold_;
  LocalProxy proxy_;
  MovableBody body_;
  FixedVector<OtherPull, 2 * kOtherPulls> pulls_;
  FixedVector<GapRow, kManifoldContacts> rows_;
  std::array<double, kManifoldContacts> multipliers_{};
  std::uint64_t beyond_validity_ = 0;
  bool heard_ = false;
  bool new_object_ = false;
};

}  // namespace tenon
