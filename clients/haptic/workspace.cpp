#include "clients/haptic/workspace.h"

#include <algorithm>

namespace tenon {

namespace {
// A minimum-jerk path's highest speed is 15/8 of its mean.
constexpr double kMinimumJerkPeak = 1.875;
constexpr double kShortestGoTo = 0.2;  // [s]

double minimumJerk(double s) { return s * s * s * (10.0 + s * (-15.0 + s * 6.0)); }
}  // namespace

void Workspace::place(const Vector3& p_WC) noexcept {
  p_WC_ = p_WC;
  v_WC_.setZero();
  going_ = false;
  free_ticks_ = options_.settle_ticks;
}

void Workspace::goTo(const Vector3& p_WC) noexcept {
  going_ = true;
  go_from_ = p_WC_;
  go_to_ = p_WC;
  go_elapsed_ = 0.0;
  const double distance = (go_to_ - go_from_).norm();
  go_duration_ = std::max(kShortestGoTo, kMinimumJerkPeak * distance / options_.go_to_speed);
}

void Workspace::step(const Vector3& p_DH, bool in_contact, double dt) noexcept {
  const Vector3 before = p_WC_;
  if (in_contact) {
    free_ticks_ = 0;
  } else if (free_ticks_ < options_.settle_ticks) {
    ++free_ticks_;
  }
  if (free_ticks_ >= options_.settle_ticks) {
    if (going_) {
      go_elapsed_ += dt;
      const double s = std::min(1.0, go_elapsed_ / go_duration_);
      p_WC_ = go_from_ + minimumJerk(s) * (go_to_ - go_from_);
      if (s >= 1.0) going_ = false;
    } else if (const double r_h = p_DH.norm(); r_h > options_.radius) {
      // eq. 1; C_h - C_w is the hand's place in the device
      p_WC_ += options_.gain * dt * (1.0 - options_.radius / r_h) * p_DH;
    }
  } else if (going_) {
    // a path broken by contact is planned anew from where it stopped, so it starts gently again
    goTo(go_to_);
  }
  v_WC_ = (p_WC_ - before) / dt;
  moving_ = p_WC_ != before;
}

}  // namespace tenon
