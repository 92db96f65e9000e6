#include "clients/simulated_person/simulated_instructor.h"

#include <algorithm>
#include <cmath>

namespace tenon::simulated_person {

namespace {
constexpr double kStallTime = 4.0;     // [s] without progress before the instructor helps
constexpr double kProgress = 0.002;    // [m] by which the error must fall to count as progress
constexpr double kMountRange = 0.15;   // [m] from the target within which a part counts as being mounted
constexpr double kClearance = 0.25;    // [m] of p_WAbove_, against the approach
constexpr double kPushGap = 0.015;     // [m] between pointer and part before the push
constexpr double kPushForce = 7.0;     // [N]
constexpr double kPushGain = 0.006;    // [m/s per N]
constexpr double kPushSpeed = 0.04;    // [m/s]
constexpr double kEntryDepth = 0.004;  // [m] by which the part has moved in when it has found the opening
constexpr double kPushTime = 12.0;     // [s] at most
constexpr double kReserve = 0.5;       // [-] fraction of the workspace radius kept for the push
}  // namespace

void SimulatedInstructor::begin(std::span<const SceneObject> objects, const Pose& X_WH) {
  objects_ = objects;
  planner_.begin(objects);
  std::size_t count = 0;
  for (const SceneObject& object : objects) {
    count = std::max<std::size_t>(count, object.object.value + 1);
    if (object.kind == "assistant") pointer_half_ = 0.5 * object.size.maxCoeff();
  }
  perception_.begin(count, person_.reaction_ticks);
  reach_controller_.start(X_WH);
  p_WHome_ = X_WH.translation();
  enter(Phase::kWatch);
}

void SimulatedInstructor::read(const StepState& step) {
  const bool active = step.phase == StepPhase::kActive;
  if (task_.active == active && task_.step == step.step && task_.started == step.started) return;
  task_ = {};
  task_.active = active;
  task_.step = step.step;
  task_.started = step.started;
  if (!step.has_target || !step.object.valid() || step.approach_W.norm() < 0.5) return;
  for (const SceneObject& object : objects_) {
    if (object.object != step.object || object.kind != "part") continue;
    task_.object = step.object;
    task_.X_WG = step.X_WG;
    task_.approach_W = step.approach_W.normalized();
    task_.tolerance = step.tolerance;
    task_.size = object.size;
    task_.centre = object.centre;
  }
}

const char* SimulatedInstructor::activity() const noexcept {
  switch (phase_) {
    case Phase::kWatch:
      return "watches";
    case Phase::kTravel:
      return "goes to the trainee";
    case Phase::kApproach:
      return "approaches";
    case Phase::kPush:
      return "pushes";
    case Phase::kRelease:
      return "releases";
    case Phase::kReturn:
      return "returns";
  }
  return "";
}

void SimulatedInstructor::enter(Phase phase) noexcept {
  phase_ = phase;
  phase_time_ = 0.0;
  stalled_time_ = 0.0;
  least_error_ = 1e9;
  approaching_ = false;
  next_waypoint_ = 0;
}

Vector3 SimulatedInstructor::targetOffset() const noexcept {
  return displacement(task_.X_WG, perception_.pose(task_.object), task_.centre).translation;
}

double SimulatedInstructor::depth() const noexcept { return targetOffset().dot(task_.approach_W); }

void SimulatedInstructor::step(const HandPerception& hand, haptic::Workspace& workspace,
                               const haptic::WorldView& world, double dt) noexcept {
  perception_.record(world);
  phase_time_ += dt;
  switch (phase_) {
    case Phase::kWatch:
      watch(hand, dt);
      break;
    case Phase::kTravel:
      moveHand(hand, side_W_ * kReserve * hand.reach, person_.max_speed, dt);
      followPath(hand, workspace, Phase::kApproach);
      break;
    case Phase::kApproach:
      moveHand(hand, side_W_ * kReserve * hand.reach, person_.max_speed, dt);
      approach(hand, workspace);
      break;
    case Phase::kPush:
      push(hand, dt);
      break;
    case Phase::kRelease:
      release(hand, dt);
      break;
    case Phase::kReturn:
      moveHand(hand, Vector3::Zero(), person_.max_speed, dt);
      followPath(hand, workspace, Phase::kWatch);
      break;
  }
}

void SimulatedInstructor::watch(const HandPerception& hand, double dt) noexcept {
  moveHand(hand, Vector3::Zero(), person_.max_speed, dt);
  if (!task_.active || !task_.object.valid() || !perception_.knows(task_.object)) {
    stalled_time_ = 0.0;
    least_error_ = 1e9;
    return;
  }
  const double error = targetOffset().norm();
  if (error > kMountRange || error < 2.0 * task_.tolerance || error < least_error_ - kProgress) {
    least_error_ = error;
    stalled_time_ = 0.0;
    return;
  }
  stalled_time_ += dt;
  if (stalled_time_ < kStallTime) return;
  planPath(hand);
  enter(Phase::kTravel);
}

void SimulatedInstructor::planPath(const HandPerception& hand) noexcept {
  const Vector3 off = targetOffset();
  const Vector3 lateral = off - off.dot(task_.approach_W) * task_.approach_W;
  side_W_ = lateral.norm() > 1e-3 ? Vector3(lateral.normalized())
                                  : Vector3(task_.approach_W.cross(Vector3::UnitZ()).normalized());
  const Pose& X_WO = perception_.pose(task_.object);
  const Vector3 half = 0.5 * X_WO.matrix().cwiseAbs() * task_.size;
  const double half_side = side_W_.cwiseAbs().dot(half);
  const Vector3 middle = X_WO * task_.centre;
  p_WPushStart_ = middle + side_W_ * (half_side + pointer_half_ + kPushGap);
  p_WAbove_ = p_WPushStart_ + side_W_ * 0.03 - task_.approach_W * kClearance;
  initial_depth_ = depth();
  path_ = planner_.plan(hand.X_WH.translation(), p_WAbove_, 0.08);
}

void SimulatedInstructor::moveHand(const HandPerception& hand, const Vector3& p_DH, double speed,
                                   double dt) noexcept {
  // in the device's axes: a motion of the workspace carries the hand along
  Pose X_DI(reach_controller_.pose().translation() - hand.p_WC, reach_controller_.pose().rotation());
  const Vector3 error = p_DH - X_DI.translation();
  const double step = std::min(error.norm(), speed * dt * std::min(1.0, 20.0 * error.norm() + 0.05));
  if (error.norm() > 1e-9) X_DI.translation() += error.normalized() * step;
  X_DI.rotation() = Quaternion::Identity();
  reach_controller_.start({X_DI.translation() + hand.p_WC, X_DI.rotation()});
  reach_controller_.stayWithin(hand.p_WC, hand.reach);
}

void SimulatedInstructor::followPath(const HandPerception& hand, haptic::Workspace& workspace,
                                     Phase next) noexcept {
  if (workspace.moveInProgress()) return;
  if (next_waypoint_ == path_.size()) {
    enter(next);
    return;
  }
  workspace.moveTo(path_[next_waypoint_] - (hand.X_WH.translation() - hand.p_WC));
  ++next_waypoint_;
}

void SimulatedInstructor::approach(const HandPerception& hand, haptic::Workspace& workspace) noexcept {
  if (workspace.moveInProgress()) return;
  if (!approaching_) {
    // the hand stays at the far side of its workspace, so that most of it is left for the push
    workspace.moveTo(p_WPushStart_ - side_W_ * kReserve * hand.reach);
    approaching_ = true;
    return;
  }
  push_depth_ = 0.0;
  reaction_ = 0.0;
  p_WPushOrigin_ = reach_controller_.pose().translation();
  enter(Phase::kPush);
}

void SimulatedInstructor::push(const HandPerception& hand, double dt) noexcept {
  reaction_ += dt / (0.03 + dt) * (hand.F_Ho_W.force.dot(side_W_) - reaction_);
  push_depth_ += dt * std::clamp(kPushGain * (kPushForce - reaction_), -kPushSpeed, kPushSpeed);
  Pose X_WI(p_WPushOrigin_ - push_depth_ * side_W_);
  reach_controller_.start(X_WI);
  reach_controller_.stayWithin(hand.p_WC, hand.reach);
  // no further than the workspace allows
  push_depth_ = (p_WPushOrigin_ - reach_controller_.pose().translation()).dot(side_W_);

  const bool step_over = !task_.active || !task_.object.valid();
  const bool entered = !step_over && depth() > initial_depth_ + kEntryDepth;
  const bool centred = !step_over && targetOffset().dot(side_W_) < 0.001;
  if (step_over || entered || centred || phase_time_ > kPushTime) {
    if (entered) ++pushes_that_helped_;
    enter(Phase::kRelease);
  }
}

void SimulatedInstructor::release(const HandPerception& hand, double dt) noexcept {
  moveHand(hand, side_W_ * kReserve * hand.reach, 0.1, dt);
  if (phase_time_ < 1.0) return;
  path_.clear();
  path_.push_back(p_WAbove_);
  for (const Vector3& point : planner_.plan(p_WAbove_, p_WHome_, 0.08)) path_.push_back(point);
  enter(Phase::kReturn);
}

}  // namespace tenon::simulated_person
