#include "clients/haptic/workspace.h"

#include <algorithm>

namespace tenon::haptic {

namespace {
// Peak over mean speed of a minimum-jerk path: 15/8.
constexpr double kMinimumJerkPeak = 1.875;  // [-]
constexpr double kShortestMove = 0.2;       // [s]

// A longer time between two steps counts as this: eq. 1 is integrated by explicit Euler, and gain * dt stays
// far below 1.
constexpr double kLongestStep = 0.01;  // [s]

// A smaller rest of a shift stays.
constexpr double kNoShift = 1e-4;  // [m]

double minimumJerk(double s) { return s * s * s * (10.0 + s * (-15.0 + s * 6.0)); }
}  // namespace

void Workspace::setCentre(const Vector3& p_WC) noexcept {
  p_WC_ = p_WC;
  v_WC_.setZero();
  shifted_.setZero();
  move_in_progress_ = false;
  free_ticks_ = options_.settle_ticks;
}

void Workspace::moveTo(const Vector3& p_WC) noexcept {
  move_in_progress_ = true;
  shifted_.setZero();
  move_from_ = p_WC_;
  move_to_ = p_WC;
  move_elapsed_ = 0.0;
  const double distance = (move_to_ - move_from_).norm();
  move_duration_ = std::max(kShortestMove, kMinimumJerkPeak * distance / options_.move_speed);
}

void Workspace::shift(const Vector3& p_CC_W) noexcept {
  p_WC_ += p_CC_W;
  shifted_ += p_CC_W;
  move_from_ += p_CC_W;  // the rest of the path is as long as before
  free_ticks_ = 0;
}

void Workspace::stepDeclutched(const Vector3& p_WH, const Vector3& p_DH, const Vector3& v_DH) noexcept {
  setCentre(p_WH - p_DH);
  free_ticks_ = 0;
  v_WC_ = -v_DH;
  moving_ = true;
}

void Workspace::step(const Vector3& p_DH, bool in_contact, double dt) noexcept {
  dt = std::min(dt, kLongestStep);
  const Vector3 before = p_WC_;
  if (in_contact) {
    free_ticks_ = 0;
  } else if (free_ticks_ < options_.settle_ticks) {
    ++free_ticks_;
  }
  if (free_ticks_ >= options_.settle_ticks) {
    if (move_in_progress_) {
      move_elapsed_ += dt;
      const double s = std::min(1.0, move_elapsed_ / move_duration_);
      p_WC_ = move_from_ + minimumJerk(s) * (move_to_ - move_from_);
      if (s >= 1.0) move_in_progress_ = false;
    } else {
      // paper eq. 1; C_h - C_w is p_DH
      if (const double r_h = p_DH.norm(); r_h > options_.radius)
        p_WC_ += options_.gain * dt * (1.0 - options_.radius / r_h) * p_DH;
      if (shifted_.norm() > kNoShift) {
        const Vector3 back = clampNorm(options_.return_gain * shifted_, options_.return_speed) * dt;
        p_WC_ -= back;
        shifted_ -= back;
      }
    }
  } else if (move_in_progress_) {
    // after a contact the path starts anew from rest
    moveTo(move_to_);
  }
  v_WC_ = (p_WC_ - before) / dt;
  moving_ = p_WC_ != before;
}

}  // namespace tenon::haptic
