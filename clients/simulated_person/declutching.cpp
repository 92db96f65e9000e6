#include "clients/simulated_person/declutching.h"

namespace tenon::simulated_person {

namespace {
constexpr double kPatience = 0.3;      // [s] at the end of the workspace before the button is pressed
constexpr double kPress = 0.1;         // [s] from the press to the motion
constexpr double kMaxSpeed = 0.15;     // [m/s] of the device meanwhile
constexpr double kOtherSide = 0.5;     // [-] of the reach, beyond the centre; indexing begins further out
constexpr double kArrived = 0.003;     // [m]
constexpr double kReturnTime = 3.0;    // [s] at most
constexpr double kForceReturns = 1.3;  // [s] of re-anchoring and soft start after the release
}  // namespace

void Declutching::enter(Phase phase) noexcept {
  phase_ = phase;
  phase_time_ = 0.0;
  at_end_time_ = 0.0;
}

bool Declutching::step(const HandPerception& hand, bool at_end, double dt) noexcept {
  phase_time_ += dt;
  const Pose X_DH(hand.X_WH.translation() - hand.p_WC, hand.X_WH.rotation());
  switch (phase_) {
    case Phase::kNone:
      at_end_time_ = at_end && hand.declutches && !hand.indexing ? at_end_time_ + dt : 0.0;
      if (at_end_time_ < kPatience) break;
      X_DG_ = Pose(-kOtherSide * hand.reach * X_DH.translation().normalized(), X_DH.rotation());
      reach_controller_.start(X_DH);
      enter(Phase::kPress);
      break;
    case Phase::kPress:
      if (phase_time_ >= kPress) enter(Phase::kReturn);
      break;
    case Phase::kReturn:
      reach_controller_.step(X_DG_, kMaxSpeed, 0.0, dt);
      if ((X_DH.translation() - X_DG_.translation()).norm() > kArrived && phase_time_ < kReturnTime) break;
      reach_controller_.start(X_DH);
      enter(Phase::kRelease);
      break;
    case Phase::kRelease:
      if (phase_time_ >= kForceReturns) enter(Phase::kNone);
      break;
  }
  return busy();
}

}  // namespace tenon::simulated_person
