#include "clients/simulated_person/assembly_behavior.h"

#include <algorithm>
#include <limits>

namespace tenon::simulated_person {

namespace {
constexpr double kWaypointRadius = 0.08;     // [m] within which an intermediate waypoint counts as passed
constexpr double kArrived = 0.004;           // [m] within which the last waypoint counts as reached
constexpr double kArrivedAngle = 0.02;       // [rad] likewise
constexpr double kTouchDistance = 0.15;      // [m] from the face of an object to where a touch begins
constexpr double kTouchForce = 1.0;          // [N]
constexpr double kTouchSpeed = 0.06;         // [m/s]
constexpr double kTouchGain = 0.06;          // [m/s per N]
constexpr double kPushForce = 5.0;           // [N]
constexpr double kSearchForce = 3.5;         // [N]
constexpr double kSeatForce = 2.0;           // [N]
constexpr double kSeatZone = 0.008;          // [m] before the target where the push is reduced to kSeatForce
constexpr double kInsertSpeed = 0.06;        // [m/s]
constexpr double kFreeSpeed = 0.20;          // [m/s] where no contact is expected
constexpr double kContactZone = 0.09;        // [m] before the target where contact is expected
constexpr double kMaxPushDepth = 0.08;       // [m] of the intended pose beyond the perceived one
constexpr double kObstructionForce = 6.0;    // [N] above which the path counts as obstructed
constexpr double kMaxSpiralRadius = 0.0065;  // [m]
constexpr double kEntryDepth = 0.0005;       // [m] of progress during the search: the object begins to enter
constexpr double kComplianceRate = 1.0;      // [1/s] of the rotation during the search
constexpr double kAssistRange = 0.1;       // [m] between the part's bounding box and the instructor's pointer
constexpr double kRetractDistance = 0.03;  // [m]
constexpr double kRetractTime = 1.0;       // [s] at least
constexpr double kRecentreTime = 4.0;      // [s] likewise, from where the arm could not continue
constexpr double kLightForce = 0.1;        // [N]
constexpr double kPressTimeout = 5.0;      // [s] of pressing at the seat after which insertion is tried again
constexpr double kIdleTimeout = 3.0;  // [s] of pushing without resistance or progress: the arm is at its end
constexpr double kWaitTimeout = 8.0;  // [s] likewise, with less than 1 N
constexpr double kVisualGain = 2.2;   // [1/s] of the alignment by sight
// [m] of error beyond which the part does not follow the hand: nothing to correct
constexpr double kVisualRange = 0.06;
constexpr double kAstray = 0.015;  // [m] beside the axis, where no spiral search finds the opening
}  // namespace

void AssemblyBehavior::begin(const Pose& X_WH) noexcept {
  X_WHome_ = X_WI_ = X_WH;
  reach_controller_.start(X_WH);
  intended_velocity_ = {};
  enter(Phase::kRest);
}

double AssemblyBehavior::contraction() const noexcept {
  switch (phase_) {
    case Phase::kTouch:
      return 0.0;
    case Phase::kSearch:
      return 1.0;
    case Phase::kSeated:
      return task_.guided_by_contact ? 0.5 : 1.0;
    case Phase::kInsert:
      return task_.misplaced ? 0.25 : 0.8;
    case Phase::kAlign:
      return 0.8;
    default:
      return 0.4;
  }
}

const char* AssemblyBehavior::activity() const noexcept {
  switch (phase_) {
    case Phase::kRest:
      return "rests";
    case Phase::kTravel:
      return goal_ == Goal::kMount ? "carries" : goal_ == Goal::kTouch ? "reaches" : "withdraws";
    case Phase::kTouch:
      return "touches";
    case Phase::kAlign:
      return "aligns";
    case Phase::kInsert:
      return task_.misplaced ? "pushes at wrong pose" : "pushes in";
    case Phase::kSearch:
      return "searches";
    case Phase::kRetract:
      return "retracts";
    case Phase::kSeated:
      return "holds";
  }
  return "";
}

void AssemblyBehavior::enter(Phase phase) noexcept {
  phase_ = phase;
  phase_time_ = 0.0;
  aligned_time_ = 0.0;
  obstructed_time_ = 0.0;
  idle_time_ = 0.0;
  retract_time_ = kRetractTime;
  deepest_ = -std::numeric_limits<double>::infinity();
}

void AssemblyBehavior::goHome(const HandPerception& hand, const PathPlanner& planner) noexcept {
  goal_ = Goal::kHome;
  travelTo(X_WHome_, hand, planner, 0.1);
}

void AssemblyBehavior::touch(const HandPerception& hand, const PathPlanner& planner,
                             const TouchTask& task) noexcept {
  goal_ = Goal::kTouch;
  p_WTouch_ = task.X_WO * task.centre;
  probe_ = 0;
  const Vector3 size_W = task.X_WO.matrix().cwiseAbs() * task.size;
  const Vector3 normal = touchNormal(size_W);
  const Vector3 p_WStart = p_WTouch_ + normal * (0.5 * normal.cwiseAbs().dot(size_W) + kTouchDistance);
  travelTo({p_WStart, Quaternion::Identity()}, hand, planner, 0.08);
  // first to the level of that face, so that the hand does not graze the object
  const Vector3 from = hand.X_WH.translation() +
                       (withdrawing_ ? path_[0] - hand.X_WH.translation() : Vector3(Vector3::Zero()));
  const double level = (p_WStart - from).dot(normal);
  if (level > 0.0 && path_.size() < 2) {
    path_.clear();
    path_.push_back(from + level * normal);
    path_.push_back(p_WStart);
  }
}

void AssemblyBehavior::mount(const HandPerception& hand, const PathPlanner& planner,
                             const MountTask& task) noexcept {
  goal_ = Goal::kMount;
  task_ = task;
  aim_error_scale_ = 1.0;
  const bool any_approach = task.approach_W.norm() < 0.5;
  axis_W_ = any_approach ? Vector3(-Vector3::UnitZ()) : task.approach_W.normalized();
  if (any_approach) task_.approach_distance = 0.0;

  Vector3 u, v;
  orthonormalBasis(axis_W_, u, v);
  Vector3 direction = random_.uniform(-1.0, 1.0) * u + random_.uniform(-1.0, 1.0) * v;
  direction = direction.norm() > 1e-3 ? direction.normalized() : u;
  const Vector3 twist =
      Vector3(random_.uniform(-1.0, 1.0), random_.uniform(-1.0, 1.0), random_.uniform(-1.0, 1.0));
  const double lateral_error = random_.uniform(person_.aim_error_min, person_.aim_error_max);
  const double angular_error = random_.uniform(person_.aim_angle_min, person_.aim_angle_max);
  aim_error_W_ = task.misplaced ? Vector3(person_.misplaced_offset * u) : Vector3(direction * lateral_error);
  aim_rotation_W_ = task.misplaced || twist.norm() < 1e-3 ? Vector3(Vector3::Zero())
                                                          : Vector3(twist.normalized() * angular_error);
  if (!task.guided_by_contact) {
    aim_error_W_.setZero();
    aim_rotation_W_.setZero();
  }
  aim();
  Pose X_WStart = X_WAim_;
  X_WStart.translation() -= axis_W_ * task_.approach_distance;
  travelTo(X_WStart * hand.X_HO.inverse(), hand, planner, 0.05);
}

void AssemblyBehavior::aim() noexcept {
  X_WAim_ = displaced(task_.X_WG, {aim_error_scale_ * aim_error_W_, aim_error_scale_ * aim_rotation_W_},
                      task_.centre);
}

void AssemblyBehavior::travelTo(const Pose& X_WH_goal, const HandPerception& hand, const PathPlanner& planner,
                                double margin) noexcept {
  planner_ = &planner;
  margin_ = margin;
  const Vector3 from = hand.X_WH.translation() + withdrawal_W_;
  path_.clear();
  withdrawing_ = withdrawal_W_.norm() > 0.0;
  if (withdrawing_) path_.push_back(from);
  for (const Vector3& point : planner.plan(from, X_WH_goal.translation(), margin)) path_.push_back(point);
  next_waypoint_ = 0;
  q_WTravel_ = X_WH_goal.rotation();
  q_WDepart_ = hand.X_WH.rotation();
  withdrawal_W_.setZero();
  visual_correction_ = {};
  transition_ = {};
  // a push ends here: start at the actual pose of the hand, not at the intended one
  reach_controller_.start(hand.X_WH);
  enter(Phase::kTravel);
}

void AssemblyBehavior::step(const HandPerception& hand, const DelayedPerception& perception,
                            double dt) noexcept {
  phase_time_ += dt;
  beyond_reach_ = false;
  const double against = -hand.F_Ho_W.force.dot(axis_W_);
  reaction_ += dt / (0.03 + dt) * (against - reaction_);
  transition_ = decayed(transition_, dt, 0.3);
  releaseMounted(hand);
  switch (phase_) {
    case Phase::kRest:
      setIntended(reach_controller_.pose(), dt);
      break;
    case Phase::kTravel:
      travel(hand, dt);
      break;
    case Phase::kTouch:
      touchStep(hand, dt);
      break;
    case Phase::kAlign:
      align(hand, perception, dt);
      break;
    case Phase::kInsert:
      insert(hand, perception, dt);
      break;
    case Phase::kSearch:
      search(hand, perception, dt);
      break;
    case Phase::kRetract:
      retract(hand, perception, dt);
      break;
    case Phase::kSeated:
      holdSeated(hand, perception, dt);
      break;
  }
}

void AssemblyBehavior::resume(const HandPerception& hand, const DelayedPerception& perception) noexcept {
  reaction_ = 0.0;
  idle_time_ = 0.0;
  obstructed_time_ = 0.0;
  const double perceived = perceivedDepth(perception);
  switch (phase_) {
    case Phase::kInsert:
    case Phase::kSearch:
    case Phase::kRetract:
    case Phase::kSeated:
      // a push starts anew from where the object is
      depth_ = std::min(depth_, perceived);
      stall_detector_.start(perceived);
      break;
    case Phase::kTouch:
      depth_ =
          std::min(depth_, (hand.X_WH.translation() - reach_controller_.pose().translation()).dot(axis_W_));
      break;
    default:
      reach_controller_.start(hand.X_WH);
      break;
  }
}

/// After the server has taken a mounted object from the hand: the intended pose becomes the actual one, so
/// that no force is left; the withdrawal is noted.
void AssemblyBehavior::releaseMounted(const HandPerception& hand) noexcept {
  const bool holding = phase_ == Phase::kAlign || phase_ == Phase::kInsert || phase_ == Phase::kSearch ||
                       phase_ == Phase::kRetract || phase_ == Phase::kSeated;
  if (!holding || hand.object == task_.object) return;
  withdrawal_W_ = -axis_W_ * std::max(0.15, task_.approach_distance);
  reach_controller_.start(hand.X_WH);
  enter(Phase::kRest);
}

void AssemblyBehavior::travel(const HandPerception& hand, double dt) noexcept {
  const bool last = next_waypoint_ + 1 >= path_.size();
  const bool withdrawing = withdrawing_ && next_waypoint_ == 0;
  const Pose X_WG(path_[next_waypoint_], withdrawing ? q_WDepart_ : q_WTravel_);
  reach_controller_.step(X_WG, person_.max_speed, person_.max_turn_speed, dt);
  beyond_reach_ = reach_controller_.stayWithin(hand.p_WC, hand.reach);
  setIntended(reach_controller_.pose(), dt);

  // obstructed for 0.4 s: a new path, up first
  obstructed_time_ = hand.F_Ho_W.force.norm() > kObstructionForce ? obstructed_time_ + dt : 0.0;
  if (obstructed_time_ > 0.4 && !withdrawing) {
    const Vector3 goal = path_[path_.size() - 1];
    const Vector3 above = hand.X_WH.translation() + Vector3(0.0, 0.0, 0.15);
    path_.clear();
    path_.push_back(above);
    for (const Vector3& point : planner_->plan(above, goal, margin_)) path_.push_back(point);
    next_waypoint_ = 0;
    withdrawing_ = false;
    reach_controller_.start(hand.X_WH);
    obstructed_time_ = 0.0;
    return;
  }
  const Displacement error = displacement(reach_controller_.pose(), X_WG);
  const bool arrived = error.translation.norm() < (last ? kArrived : kWaypointRadius) &&
                       (!last || error.rotation.norm() < kArrivedAngle);
  if (!arrived) return;
  if (!last) {
    ++next_waypoint_;
    return;
  }
  reaction_ = 0.0;
  switch (goal_) {
    case Goal::kHome:
      enter(Phase::kRest);
      break;
    case Goal::kTouch:
      axis_W_ = (p_WTouch_ - reach_controller_.pose().translation()).normalized();
      depth_ = 0.0;
      enter(Phase::kTouch);
      break;
    case Goal::kMount:
      enter(Phase::kAlign);
      break;
  }
}

void AssemblyBehavior::touchStep(const HandPerception& hand, double dt) noexcept {
  depth_ += dt * std::clamp(kTouchGain * (kTouchForce - reaction_), -kTouchSpeed, kTouchSpeed);
  Pose X_WI = reach_controller_.pose();
  X_WI.translation() += axis_W_ * depth_;
  setIntended(X_WI, dt);
  // no contact up to 3 cm beyond the expected surface: an opening; probe another point
  const double expected_depth = (p_WTouch_ - reach_controller_.pose().translation()).dot(axis_W_);
  if (reaction_ > 0.3 || depth_ < expected_depth + 0.03) return;
  reach_controller_.start(hand.X_WH);
  axis_W_ = (p_WTouch_ + probeOffset(probe_++) - hand.X_WH.translation()).normalized();
  depth_ = 0.0;
  reaction_ = 0.0;
}

void AssemblyBehavior::align(const HandPerception& hand, const DelayedPerception& perception,
                             double dt) noexcept {
  Pose X_WStart = X_WAim_;
  X_WStart.translation() -= axis_W_ * task_.approach_distance;
  reach_controller_.step(X_WStart * hand.X_HO.inverse(), person_.max_speed, person_.max_turn_speed, dt);
  beyond_reach_ = reach_controller_.stayWithin(hand.p_WC, hand.reach);
  setIntended(displaced(reach_controller_.pose(), visual_correction_), dt);
  if (!perception.knows(task_.object)) return;

  // integral correction by sight; its gain is low enough to be stable with the reaction delay
  const Displacement error = displacement(perception.pose(task_.object), X_WStart, task_.centre);
  // a hand that is frozen or obstructed would wind the integral up
  if (error.translation.norm() > kVisualRange) {
    visual_correction_ = decayed(visual_correction_, dt, 0.3);
  } else {
    visual_correction_.translation += kVisualGain * dt * error.translation;
    visual_correction_.rotation += kVisualGain * dt * error.rotation;
    visual_correction_ = {clampNorm(visual_correction_.translation, 0.05),
                          clampNorm(visual_correction_.rotation, 0.2)};
  }
  const bool arrived =
      error.translation.norm() < std::min(0.001, 0.4 * task_.tolerance) && error.rotation.norm() < 0.008;
  aligned_time_ = arrived ? aligned_time_ + dt : 0.0;
  if (aligned_time_ < 0.2 && (phase_time_ < 6.0 || isAstray(perception))) return;
  if (task_.approach_distance <= 0.0) {
    // no direction of approach: nothing to insert into, keep aligning
    return;
  }
  depth_ = -task_.approach_distance;
  stall_detector_.start(perceivedDepth(perception));
  enter(Phase::kInsert);
}

void AssemblyBehavior::insert(const HandPerception& hand, const DelayedPerception& perception,
                              double dt) noexcept {
  const double perceived = perceivedDepth(perception);
  const double force = perceived > -kSeatZone ? kSeatForce : kPushForce;
  const bool far = depth_ < -kContactZone && reaction_ < 1.0;
  if (far) {
    const double distance = -kContactZone - depth_;
    depth_ += dt * std::min({kFreeSpeed, kInsertSpeed + 4.0 * distance, 0.05 + 0.5 * phase_time_});
  } else {
    depth_ += pushStep(force, reaction_, kInsertSpeed, dt);
  }
  correctTilt(perception, dt);
  // without resistance the intended pose stops at the target
  if (reaction_ < 0.5) depth_ = std::min(depth_, 0.0);
  depth_ = std::min(depth_, std::min(perceived, 0.0) + kMaxPushDepth);
  if (task_.misplaced && isHelped(perception)) {
    // follow the push of the instructor
    const Vector3 lateral_force = hand.F_Ho_W.force + reaction_ * axis_W_;
    const Vector3 lateral = lateral_force - lateral_force.dot(axis_W_) * axis_W_;
    if (lateral.norm() > 1.0) comply(perception, 0.5, dt);
  }
  intendObjectPose(hand, Vector3::Zero(), Quaternion::Identity(), dt);
  if (!task_.guided_by_contact) {
    if (depth_ >= -1e-4) enter(Phase::kSeated);
    return;
  }
  const bool in_place = -perceived < std::max(0.003, 1.5 * task_.tolerance);
  if (in_place && (stall_detector_.stalled(perceivedDepth(perception), 0.0005) || depth_ >= 0.0)) {
    enter(Phase::kSeated);
    return;
  }
  // back at the begin of the approach the part is out of contact, so that the workspace can follow the hand
  const bool idle = perceived < deepest_ + 0.001 && reaction_ < 0.5 && !task_.misplaced;
  deepest_ = std::max(deepest_, perceived);
  idle_time_ = idle ? idle_time_ + dt : 0.0;
  if (idle_time_ > kIdleTimeout) {
    search_depth_ = kRetractDistance - task_.approach_distance;
    enter(Phase::kRetract);
    retract_time_ = kRecentreTime;
    return;
  }
  if (reaction_ < 0.6 * force || task_.misplaced ||
      !stall_detector_.stalled(perceivedDepth(perception), 0.001))
    return;
  if (isAstray(perception)) {
    search_depth_ = kRetractDistance - task_.approach_distance;
    enter(Phase::kRetract);
    return;
  }
  search_depth_ = perceived;
  spiral_search_ = {};
  enter(Phase::kSearch);
}

void AssemblyBehavior::search(const HandPerception& hand, const DelayedPerception& perception,
                              double dt) noexcept {
  depth_ += pushStep(kSearchForce, reaction_, 0.03, dt);
  correctTilt(perception, dt);
  depth_ = std::min(depth_, std::min(perceivedDepth(perception), 0.0) + kMaxPushDepth);
  const bool near = perceivedDepth(perception) > search_depth_ + kEntryDepth;
  spiral_search_.step(near, dt);
  complyInRotation(perception, kComplianceRate, dt);
  intendObjectPose(hand, spiral_search_.offset(axis_W_), spiral_search_.tilt(axis_W_), dt);

  const double perceived = perceivedDepth(perception);
  if (perceived > search_depth_ + 0.0025) {
    // entered: continue from the present pose of the object in the hand
    comply(perception, 1.0 / dt, dt);
    transition_ = displacement(X_WAim_ * hand.X_HO.inverse(), X_WI_);
    transition_.translation -= visual_correction_.translation;
    transition_.translation -= axis_W_ * transition_.translation.dot(axis_W_);
    stall_detector_.start(perceived);
    enter(Phase::kInsert);
  } else if (spiral_search_.radius() > kMaxSpiralRadius) {
    aim_error_scale_ *= 0.6;
    enter(Phase::kRetract);
  }
}

void AssemblyBehavior::retract(const HandPerception& hand, const DelayedPerception& perception,
                               double dt) noexcept {
  const double retracted = search_depth_ - kRetractDistance;
  depth_ = std::max(retracted, depth_ - kInsertSpeed * dt);
  intendObjectPose(hand, Vector3::Zero(), Quaternion::Identity(), dt);
  if (depth_ > retracted || phase_time_ < retract_time_) return;
  aim();
  if (!task_.misplaced && isAstray(perception)) {
    visual_correction_ = {};
    enter(Phase::kAlign);
    return;
  }
  stall_detector_.start(perceivedDepth(perception));
  enter(Phase::kInsert);
}

void AssemblyBehavior::holdSeated(const HandPerception& hand, const DelayedPerception& perception,
                                  double dt) noexcept {
  withdrawal_W_ = -axis_W_ * std::max(0.15, task_.approach_distance);
  if (task_.guided_by_contact) {
    depth_ += pushStep(kSeatForce, reaction_, 0.03, dt);
    if (reaction_ < 0.5) depth_ = std::min(depth_, 0.0);
    depth_ = std::min(depth_, kMaxPushDepth);
    // the seat guides the object: comply laterally
    if (reaction_ > 1.0) comply(perception, 1.5, dt);
    intendObjectPose(hand, Vector3::Zero(), Quaternion::Identity(), dt);
    const double patience = reaction_ > 1.0 ? kPressTimeout : kWaitTimeout;
    if (hand.F_Ho_W.force.norm() > kLightForce && phase_time_ > patience) {
      search_depth_ = perceivedDepth(perception);
      aim_error_scale_ *= 0.6;
      enter(Phase::kRetract);
    }
    return;
  }
  // not guided by contact: keep aligning by sight
  const Displacement error = displacement(perception.pose(task_.object), X_WAim_, task_.centre);
  visual_correction_.translation += 1.0 * dt * error.translation;
  visual_correction_.rotation += 1.0 * dt * error.rotation;
  intendObjectPose(hand, Vector3::Zero(), Quaternion::Identity(), dt);
}

void AssemblyBehavior::comply(const DelayedPerception& perception, double rate, double dt) noexcept {
  if (!perception.knows(task_.object)) return;
  X_WAim_ = compliedLaterally(perception.pose(task_.object), X_WAim_, task_.centre, axis_W_,
                              std::min(1.0, rate * dt));
  complyInRotation(perception, rate, dt);
}

void AssemblyBehavior::complyInRotation(const DelayedPerception& perception, double rate,
                                        double dt) noexcept {
  if (!perception.knows(task_.object)) return;
  X_WAim_ = compliedInRotation(perception.pose(task_.object), X_WAim_, task_.X_WG, task_.centre,
                               std::min(1.0, rate * dt));
}

bool AssemblyBehavior::isHelped(const DelayedPerception& perception) const noexcept {
  if (!perception.knows(task_.assistant) || !perception.knows(task_.object)) return false;
  const Vector3 p_WPointer = perception.pose(task_.assistant) * task_.assistant_centre;
  const Vector3 p_OC = perception.pose(task_.object).inverse() * p_WPointer - task_.centre;
  return (p_OC.cwiseAbs() - 0.5 * task_.size).cwiseMax(0.0).norm() < kAssistRange;
}

void AssemblyBehavior::correctTilt(const DelayedPerception& perception, double dt) noexcept {
  if (!perception.knows(task_.object)) return;
  visual_correction_.rotation =
      tiltCorrection(visual_correction_.rotation, perception.pose(task_.object), X_WAim_, dt);
}

void AssemblyBehavior::intendObjectPose(const HandPerception& hand, const Vector3& offset_W,
                                        const Quaternion& tilt, double dt) noexcept {
  const Quaternion q_WO = tilt * X_WAim_.rotation();
  const Vector3 p_WCentre = X_WAim_ * task_.centre + axis_W_ * depth_ + offset_W;
  const Pose X_WO(p_WCentre - q_WO * task_.centre, q_WO);
  const Pose X_WH = displaced(displaced(X_WO * hand.X_HO.inverse(), visual_correction_), transition_);
  reach_controller_.start(X_WH);
  beyond_reach_ = reach_controller_.stayWithin(hand.p_WC, hand.reach);
  setIntended(reach_controller_.pose(), dt);
}

void AssemblyBehavior::setIntended(const Pose& X_WI, double dt) noexcept {
  const Displacement change = displacement(X_WI_, X_WI);
  intended_velocity_ = {change.translation / dt, change.rotation / dt};
  // a new plan may make the intended pose jump; such a jump is no velocity
  if (intended_velocity_.linear.norm() > 2.0 * person_.max_speed) intended_velocity_.linear.setZero();
  if (intended_velocity_.angular.norm() > 2.0 * person_.max_turn_speed) intended_velocity_.angular.setZero();
  X_WI_ = X_WI;
}

bool AssemblyBehavior::isAstray(const DelayedPerception& perception) const noexcept {
  if (!perception.knows(task_.object)) return false;
  const Vector3 error = displacement(X_WAim_, perception.pose(task_.object), task_.centre).translation;
  return (error - error.dot(axis_W_) * axis_W_).norm() > kAstray;
}

double AssemblyBehavior::perceivedDepth(const DelayedPerception& perception) const noexcept {
  if (!perception.knows(task_.object)) return depth_;
  return displacement(X_WAim_, perception.pose(task_.object), task_.centre).translation.dot(axis_W_);
}

}  // namespace tenon::simulated_person
