#include "clients/instructor/simulated_instructor.h"

#include <algorithm>
#include <cmath>

namespace tenon {

namespace {
constexpr double kPatience = 4.0;     // [s] without progress before help comes
constexpr double kProgress = 0.002;   // [m] that counts as getting nearer
constexpr double kNearTarget = 0.15;  // [m] from the ghost a part counts as being mounted
constexpr double kAbove = 0.25;       // [m] out of the way, against the approach
constexpr double kBesideGap = 0.015;  // [m] between cube and part before the push
constexpr double kPushForce = 7.0;    // [N]
constexpr double kPushGain = 0.006;   // [m/s per N]
constexpr double kPushSpeed = 0.04;   // [m/s]
constexpr double kDropped = 0.004;    // [m] the part went in: it found its way
constexpr double kPushTime = 12.0;    // [s] at most
constexpr double kReserve = 0.5;      // of the reach, held back to push with
}  // namespace

void SimulatedInstructor::begin(std::span<const SceneObject> objects, const Pose& X_WH) {
  objects_ = objects;
  clear_way_.begin(objects);
  std::size_t count = 0;
  for (const SceneObject& object : objects) {
    count = std::max<std::size_t>(count, object.object.value + 1);
    if (object.kind == "assistant") cube_half_ = 0.5 * object.size.maxCoeff();
  }
  sight_.begin(count, person_.reaction_ticks);
  reach_.start(X_WH);
  p_WHome_ = X_WH.translation();
  enter(Phase::kWatch);
}

void SimulatedInstructor::read(const StepState& step) {
  const bool active = step.phase == StepPhase::kActive;
  if (concern_.active == active && concern_.step == step.step && concern_.started == step.started) return;
  concern_ = {};
  concern_.active = active;
  concern_.step = step.step;
  concern_.started = step.started;
  if (!step.has_target || !step.object.valid() || step.approach_W.norm() < 0.5) return;
  for (const SceneObject& object : objects_) {
    if (object.object != step.object || object.kind != "part") continue;
    concern_.object = step.object;
    concern_.X_WG = step.X_WG;
    concern_.approach_W = step.approach_W.normalized();
    concern_.tolerance = step.tolerance;
    concern_.size = object.size;
    concern_.centre = object.centre;
  }
}

const char* SimulatedInstructor::doing() const noexcept {
  switch (phase_) {
    case Phase::kWatch:
      return "watches";
    case Phase::kGoThere:
      return "goes to the trainee";
    case Phase::kComeNear:
      return "comes near";
    case Phase::kPush:
      return "pushes";
    case Phase::kLetGo:
      return "lets go";
    case Phase::kGoBack:
      return "withdraws";
  }
  return "";
}

void SimulatedInstructor::enter(Phase phase) noexcept {
  phase_ = phase;
  phase_time_ = 0.0;
  watched_ = 0.0;
  best_error_ = 1e9;
  under_way_ = false;
  next_ = 0;
}

Vector3 SimulatedInstructor::offTarget() const noexcept {
  return sight_.pose(concern_.object).translation() - concern_.X_WG.translation();
}

double SimulatedInstructor::depth() const noexcept { return offTarget().dot(concern_.approach_W); }

void SimulatedInstructor::step(const HandSense& hand, Workspace& workspace, const WorldView& world,
                               double dt) noexcept {
  sight_.look(world);
  phase_time_ += dt;
  switch (phase_) {
    case Phase::kWatch:
      watch(hand, dt);
      break;
    case Phase::kGoThere:
      moveHand(hand, side_W_ * kReserve * hand.reach, person_.max_speed, dt);
      goAlong(hand, workspace, Phase::kComeNear);
      break;
    case Phase::kComeNear:
      moveHand(hand, side_W_ * kReserve * hand.reach, person_.max_speed, dt);
      comeNear(hand, workspace);
      break;
    case Phase::kPush:
      push(hand, dt);
      break;
    case Phase::kLetGo:
      letGo(hand, dt);
      break;
    case Phase::kGoBack:
      moveHand(hand, Vector3::Zero(), person_.max_speed, dt);
      goAlong(hand, workspace, Phase::kWatch);
      break;
  }
}

void SimulatedInstructor::watch(const HandSense& hand, double dt) noexcept {
  moveHand(hand, Vector3::Zero(), person_.max_speed, dt);
  if (!concern_.active || !concern_.object.valid() || !sight_.knows(concern_.object)) {
    watched_ = 0.0;
    best_error_ = 1e9;
    return;
  }
  const double error = offTarget().norm();
  if (error > kNearTarget || error < 2.0 * concern_.tolerance || error < best_error_ - kProgress) {
    best_error_ = error;
    watched_ = 0.0;
    return;
  }
  watched_ += dt;
  if (watched_ < kPatience) return;
  planWay(hand);
  enter(Phase::kGoThere);
}

void SimulatedInstructor::planWay(const HandSense& hand) noexcept {
  const Vector3 off = offTarget();
  const Vector3 lateral = off - off.dot(concern_.approach_W) * concern_.approach_W;
  side_W_ = lateral.norm() > 1e-3 ? Vector3(lateral.normalized())
                                  : Vector3(concern_.approach_W.cross(Vector3::UnitZ()).normalized());
  const Pose& X_WO = sight_.pose(concern_.object);
  const Vector3 half = 0.5 * X_WO.matrix().cwiseAbs() * concern_.size;
  const double half_side = side_W_.cwiseAbs().dot(half);
  const Vector3 middle = X_WO * concern_.centre;
  p_WBeside_ = middle + side_W_ * (half_side + cube_half_ + kBesideGap);
  p_WAbove_ = p_WBeside_ + side_W_ * 0.03 - concern_.approach_W * kAbove;
  depth_before_ = depth();
  way_ = clear_way_.plan(hand.X_WH.translation(), p_WAbove_, 0.08);
}

void SimulatedInstructor::moveHand(const HandSense& hand, const Vector3& p_DH, double speed,
                                   double dt) noexcept {
  // carried along by the workspace: the way of the hand is the device's alone
  Pose X_DI(reach_.pose().translation() - hand.p_WC, reach_.pose().rotation());
  const Vector3 way = p_DH - X_DI.translation();
  const double step = std::min(way.norm(), speed * dt * std::min(1.0, 20.0 * way.norm() + 0.05));
  if (way.norm() > 1e-9) X_DI.translation() += way.normalized() * step;
  X_DI.rotation() = Quaternion::Identity();
  reach_.start({X_DI.translation() + hand.p_WC, X_DI.rotation()});
  reach_.stayWithin(hand.p_WC, hand.reach);
}

void SimulatedInstructor::goAlong(const HandSense& hand, Workspace& workspace, Phase next) noexcept {
  if (workspace.going()) return;
  if (next_ == way_.size()) {
    enter(next);
    return;
  }
  workspace.goTo(way_[next_] - (hand.X_WH.translation() - hand.p_WC));
  ++next_;
}

void SimulatedInstructor::comeNear(const HandSense& hand, Workspace& workspace) noexcept {
  if (workspace.going()) return;
  if (!under_way_) {
    // the hand waits at the far side of its reach, so that all of it is left to push
    workspace.goTo(p_WBeside_ - side_W_ * kReserve * hand.reach);
    under_way_ = true;
    return;
  }
  pushed_ = 0.0;
  felt_ = 0.0;
  p_WPush_ = reach_.pose().translation();
  enter(Phase::kPush);
}

void SimulatedInstructor::push(const HandSense& hand, double dt) noexcept {
  felt_ += dt / (0.03 + dt) * (hand.F_Ho_W.force.dot(side_W_) - felt_);
  pushed_ += dt * std::clamp(kPushGain * (kPushForce - felt_), -kPushSpeed, kPushSpeed);
  Pose X_WI(p_WPush_ - pushed_ * side_W_);
  reach_.start(X_WI);
  reach_.stayWithin(hand.p_WC, hand.reach);
  // not further into it than the arm's reach shows
  pushed_ = (p_WPush_ - reach_.pose().translation()).dot(side_W_);

  const bool gone = !concern_.active || !concern_.object.valid();
  const bool dropped = !gone && depth() > depth_before_ + kDropped;
  const bool there = !gone && offTarget().dot(side_W_) < 0.001;
  if (gone || dropped || there || phase_time_ > kPushTime) {
    if (dropped) ++helped_;
    enter(Phase::kLetGo);
  }
}

void SimulatedInstructor::letGo(const HandSense& hand, double dt) noexcept {
  moveHand(hand, side_W_ * kReserve * hand.reach, 0.1, dt);
  if (phase_time_ < 1.0) return;
  way_.clear();
  way_.push_back(p_WAbove_);
  for (const Vector3& point : clear_way_.plan(p_WAbove_, p_WHome_, 0.08)) way_.push_back(point);
  enter(Phase::kGoBack);
}

}  // namespace tenon
