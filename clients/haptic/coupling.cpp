#include "clients/haptic/coupling.h"

#include <algorithm>

namespace tenon::haptic {

namespace {
// Time constant of the low-pass filter of the stretch rate. It smooths encoder quantisation and is well below
// the 30 ms in which a hand settles at a wall.
constexpr double kRateFilter = 0.005;  // [s]

Vector3 masked(const Vector3& v, std::uint32_t axes) {
  return {(axes & 1U) != 0 ? v.x() : 0.0, (axes & 2U) != 0 ? v.y() : 0.0, (axes & 4U) != 0 ? v.z() : 0.0};
}
}  // namespace

Wrench Coupling::step(const LocalProxy& proxy, const Pose& X_WH, double dt) noexcept {
  if (proxy.discontinuous) has_stretch_ = false;
  const Displacement before = stretch_;
  stretch_ = proxy.active ? displacement(X_WH, proxy.X_WS) : Displacement{};
  if (has_stretch_) {
    const double blend = dt / (kRateFilter + dt);
    stretch_rate_.translation +=
        blend * ((stretch_.translation - before.translation) / dt - stretch_rate_.translation);
    stretch_rate_.rotation += blend * ((stretch_.rotation - before.rotation) / dt - stretch_rate_.rotation);
  } else {
    stretch_rate_ = {};
  }
  // the filter of the rate would keep a NaN
  has_stretch_ = proxy.active && stretch_.translation.allFinite() && stretch_.rotation.allFinite();

  stiffness_ = std::min(proxy.stiffness, options_.max_stiffness);
  rotational_stiffness_ = std::min(proxy.rotational_stiffness, options_.max_rotational_stiffness);
  const double damping_factor =
      proxy.stiffness > 0.0 ? std::min(1.0, proxy.stiffness / options_.max_stiffness) : 0.0;
  Wrench wrench;
  wrench.force =
      stiffness_ * stretch_.translation + damping_factor * options_.damping * stretch_rate_.translation;
  wrench.torque = rotational_stiffness_ * stretch_.rotation +
                  damping_factor * options_.rotational_damping * stretch_rate_.rotation;
  wrench.force = masked(wrench.force, options_.dof_mask);
  wrench.torque = masked(wrench.torque, options_.dof_mask >> 3U);
  return wrench;
}

void Coupling::reset() noexcept {
  stretch_ = {};
  stretch_rate_ = {};
  has_stretch_ = false;
}

}  // namespace tenon::haptic
