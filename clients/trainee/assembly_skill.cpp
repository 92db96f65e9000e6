#include "clients/trainee/assembly_skill.h"

#include <algorithm>

namespace tenon {

namespace {
constexpr double kPassBy = 0.08;          // [m] near enough to a point on the way
constexpr double kThere = 0.004;          // [m] near enough to its end
constexpr double kFacing = 0.02;          // [rad]
constexpr double kStandOff = 0.15;        // [m] before a thing to be touched she slows down
constexpr double kTouchForce = 1.0;       // [N]
constexpr double kTouchSpeed = 0.06;      // [m/s]
constexpr double kTouchGain = 0.06;       // [m/s per N]
constexpr double kPushForce = 5.0;        // [N]
constexpr double kSearchForce = 3.5;      // [N]
constexpr double kSeatForce = 2.0;        // [N]
constexpr double kSeatNear = 0.008;       // [m] before the target she pushes no harder than that
constexpr double kInsertSpeed = 0.06;     // [m/s]
constexpr double kFreeSpeed = 0.20;       // [m/s] as long as there is nothing near to push against
constexpr double kNear = 0.09;            // [m] before the target she expects to meet something
constexpr double kLongestPush = 0.08;     // [m] the intent goes ahead of the object
constexpr double kBump = 6.0;             // [N] on the way: she hit something
constexpr double kSpiralWidest = 0.0065;  // [m]
constexpr double kDip = 0.0005;           // [m] it goes deeper than it stood: the way in is near
constexpr double kComply = 1.0;           // [1/s] at which a hand that presses takes on how the part lies
constexpr double kHelped = 0.1;           // [m] between a part's outline and the helper's cube
constexpr double kBackOffWay = 0.03;      // [m]
constexpr double kHardlyFelt = 0.1;       // [N]
constexpr double kPressedInVain = 5.0;    // [s] nobody says that it sits: she tries again
constexpr double kWaitedInVain = 8.0;     // [s] likewise, when she hardly presses
constexpr double kLookGain = 2.2;         // [1/s] at which a hand follows the eye
}  // namespace

void AssemblySkill::begin(const Pose& X_WH) noexcept {
  X_WHome_ = X_WI_ = X_WH;
  reach_.start(X_WH);
  intent_velocity_ = {};
  enter(Phase::kRest);
}

double AssemblySkill::contraction() const noexcept {
  switch (phase_) {
    case Phase::kTouch:
      return 0.0;
    case Phase::kSearch:
      return 1.0;
    case Phase::kSeated:
      return task_.by_touch ? 0.5 : 1.0;
    case Phase::kInsert:
      return task_.sure_of_it ? 0.25 : 0.8;
    case Phase::kAlign:
      return 0.8;
    default:
      return 0.4;
  }
}

const char* AssemblySkill::doing() const noexcept {
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
      return task_.sure_of_it ? "insists" : "pushes in";
    case Phase::kSearch:
      return "searches";
    case Phase::kBackOff:
      return "backs off";
    case Phase::kSeated:
      return "holds";
  }
  return "";
}

void AssemblySkill::enter(Phase phase) noexcept {
  phase_ = phase;
  phase_time_ = 0.0;
  aligned_time_ = 0.0;
  bump_time_ = 0.0;
}

void AssemblySkill::goHome(const HandSense& sense, const ClearWay& clear_way) noexcept {
  goal_ = Goal::kHome;
  travelTo(X_WHome_, sense, clear_way, 0.1);
}

void AssemblySkill::touch(const HandSense& sense, const ClearWay& clear_way, const TouchTask& task) noexcept {
  goal_ = Goal::kTouch;
  p_WTouch_ = task.X_WO * task.centre;
  probe_ = 0;
  const Vector3 size_W = task.X_WO.matrix().cwiseAbs() * task.size;
  const Vector3 side = sideToTouch(size_W);
  const Vector3 before = p_WTouch_ + side * (0.5 * side.cwiseAbs().dot(size_W) + kStandOff);
  travelTo({before, Quaternion::Identity()}, sense, clear_way, 0.08);
  // first to that side of it, so that the hand does not graze it on the way
  const Vector3 from = sense.X_WH.translation() +
                       (backing_out_ ? way_[0] - sense.X_WH.translation() : Vector3(Vector3::Zero()));
  const double level = (before - from).dot(side);
  if (level > 0.0 && way_.size() < 2) {
    way_.clear();
    way_.push_back(from + level * side);
    way_.push_back(before);
  }
}

void AssemblySkill::mount(const HandSense& sense, const ClearWay& clear_way, const MountTask& task) noexcept {
  goal_ = Goal::kMount;
  task_ = task;
  attempts_ = 0;
  bias_scale_ = 1.0;
  const bool any_way = task.approach_W.norm() < 0.5;
  axis_W_ = any_way ? Vector3(-Vector3::UnitZ()) : task.approach_W.normalized();
  if (any_way) task_.approach_distance = 0.0;

  Vector3 u, v;
  besides(axis_W_, u, v);
  Vector3 direction = random_.uniform(-1.0, 1.0) * u + random_.uniform(-1.0, 1.0) * v;
  direction = direction.norm() > 1e-3 ? direction.normalized() : u;
  const Vector3 twist =
      Vector3(random_.uniform(-1.0, 1.0), random_.uniform(-1.0, 1.0), random_.uniform(-1.0, 1.0));
  const double beside = random_.uniform(person_.aim_error_min, person_.aim_error_max);
  const double turned = random_.uniform(person_.aim_angle_min, person_.aim_angle_max);
  bias_W_ = task.sure_of_it ? Vector3(person_.stubborn_offset * u) : Vector3(direction * beside);
  bias_rotation_W_ = task.sure_of_it || twist.norm() < 1e-3 ? Vector3(Vector3::Zero())
                                                            : Vector3(twist.normalized() * turned);
  if (!task.by_touch) {
    bias_W_.setZero();
    bias_rotation_W_.setZero();
  }
  aim();
  Pose X_WBefore = X_WAim_;
  X_WBefore.translation() -= axis_W_ * task_.approach_distance;
  travelTo(X_WBefore * sense.X_HO.inverse(), sense, clear_way, 0.05);
}

void AssemblySkill::aim() noexcept {
  X_WAim_ = displaced(task_.X_WG, {bias_scale_ * bias_W_, bias_scale_ * bias_rotation_W_});
}

void AssemblySkill::travelTo(const Pose& X_WH_goal, const HandSense& sense, const ClearWay& clear_way,
                             double margin) noexcept {
  clear_way_ = &clear_way;
  margin_ = margin;
  const Vector3 from = sense.X_WH.translation() + back_out_W_;
  way_.clear();
  backing_out_ = back_out_W_.norm() > 0.0;
  if (backing_out_) way_.push_back(from);
  for (const Vector3& point : clear_way.plan(from, X_WH_goal.translation(), margin)) way_.push_back(point);
  next_ = 0;
  q_WTravel_ = X_WH_goal.rotation();
  q_WDepart_ = sense.X_WH.rotation();
  back_out_W_.setZero();
  nudge_ = {};
  carry_ = {};
  // what was pushed against is let go: the hand starts from where it is, not from where it wanted to be
  reach_.start(sense.X_WH);
  enter(Phase::kTravel);
}

void AssemblySkill::step(const HandSense& sense, const DelayedSight& sight, double dt) noexcept {
  phase_time_ += dt;
  const double against = -sense.F_Ho_W.force.dot(axis_W_);
  felt_ += dt / (0.03 + dt) * (against - felt_);
  carry_ = faded(carry_, dt, 0.3);
  letGoOfMounted(sense);
  switch (phase_) {
    case Phase::kRest:
      setIntent(reach_.pose(), dt);
      break;
    case Phase::kTravel:
      travel(sense, dt);
      break;
    case Phase::kTouch:
      touching(sense, dt);
      break;
    case Phase::kAlign:
      align(sense, sight, dt);
      break;
    case Phase::kInsert:
      insert(sense, sight, dt);
      break;
    case Phase::kSearch:
      search(sense, sight, dt);
      break;
    case Phase::kBackOff:
      backOff(sense, sight, dt);
      break;
    case Phase::kSeated:
      seated(sense, sight, dt);
      break;
  }
}

/// What is in its place has left the hand: it goes limp where it is, before it withdraws.
void AssemblySkill::letGoOfMounted(const HandSense& sense) noexcept {
  const bool holding = phase_ == Phase::kAlign || phase_ == Phase::kInsert || phase_ == Phase::kSearch ||
                       phase_ == Phase::kBackOff || phase_ == Phase::kSeated;
  if (!holding || sense.object == task_.object) return;
  back_out_W_ = -axis_W_ * std::max(0.15, task_.approach_distance);
  reach_.start(sense.X_WH);
  enter(Phase::kRest);
}

void AssemblySkill::travel(const HandSense& sense, double dt) noexcept {
  const bool last = next_ + 1 >= way_.size();
  const bool backing = backing_out_ && next_ == 0;
  const Pose X_WG(way_[next_], backing ? q_WDepart_ : q_WTravel_);
  reach_.step(X_WG, person_.max_speed, person_.max_turn_speed, dt);
  reach_.stayWithin(sense.p_WC, sense.reach);
  setIntent(reach_.pose(), dt);

  // something in the way: up and over it
  bump_time_ = sense.F_Ho_W.force.norm() > kBump ? bump_time_ + dt : 0.0;
  if (bump_time_ > 0.4 && !backing) {
    const Vector3 goal = way_[way_.size() - 1];
    const Vector3 above = sense.X_WH.translation() + Vector3(0.0, 0.0, 0.15);
    way_.clear();
    way_.push_back(above);
    for (const Vector3& point : clear_way_->plan(above, goal, margin_)) way_.push_back(point);
    next_ = 0;
    backing_out_ = false;
    reach_.start(sense.X_WH);
    bump_time_ = 0.0;
    return;
  }
  const Displacement left = displacement(reach_.pose(), X_WG);
  const bool there =
      left.translation.norm() < (last ? kThere : kPassBy) && (!last || left.rotation.norm() < kFacing);
  if (!there) return;
  if (!last) {
    ++next_;
    return;
  }
  felt_ = 0.0;
  switch (goal_) {
    case Goal::kHome:
      enter(Phase::kRest);
      break;
    case Goal::kTouch:
      axis_W_ = (p_WTouch_ - reach_.pose().translation()).normalized();
      depth_ = 0.0;
      enter(Phase::kTouch);
      break;
    case Goal::kMount:
      enter(Phase::kAlign);
      break;
  }
}

void AssemblySkill::touching(const HandSense& sense, double dt) noexcept {
  depth_ += dt * std::clamp(kTouchGain * (kTouchForce - felt_), -kTouchSpeed, kTouchSpeed);
  Pose X_WI = reach_.pose();
  X_WI.translation() += axis_W_ * depth_;
  setIntent(X_WI, dt);
  // through where it should be and nothing felt: it is open there; feel around in it
  const double way_to_it = (p_WTouch_ - reach_.pose().translation()).dot(axis_W_);
  if (felt_ > 0.3 || depth_ < way_to_it + 0.03) return;
  reach_.start(sense.X_WH);
  axis_W_ = (p_WTouch_ + probeAround(probe_++) - sense.X_WH.translation()).normalized();
  depth_ = 0.0;
  felt_ = 0.0;
}

void AssemblySkill::align(const HandSense& sense, const DelayedSight& sight, double dt) noexcept {
  Pose X_WBefore = X_WAim_;
  X_WBefore.translation() -= axis_W_ * task_.approach_distance;
  reach_.step(X_WBefore * sense.X_HO.inverse(), person_.max_speed, person_.max_turn_speed, dt);
  reach_.stayWithin(sense.p_WC, sense.reach);
  setIntent(displaced(reach_.pose(), nudge_), dt);
  if (!sight.knows(task_.object)) return;

  // look, and lean towards where it should be: slower than a reaction takes
  const Displacement off = displacement(sight.pose(task_.object), X_WBefore);
  nudge_.translation += kLookGain * dt * off.translation;
  nudge_.rotation += kLookGain * dt * off.rotation;
  nudge_ = {noLongerThan(nudge_.translation, 0.05), noLongerThan(nudge_.rotation, 0.2)};
  const bool there =
      off.translation.norm() < std::min(0.001, 0.4 * task_.tolerance) && off.rotation.norm() < 0.008;
  aligned_time_ = there ? aligned_time_ + dt : 0.0;
  if (aligned_time_ < 0.2 && phase_time_ < 6.0) return;
  if (task_.approach_distance <= 0.0) {
    // nothing to push into: stay there, looking
    return;
  }
  depth_ = -task_.approach_distance;
  stall_watch_.start(depthSeen(sight));
  ++attempts_;
  enter(Phase::kInsert);
}

void AssemblySkill::insert(const HandSense& sense, const DelayedSight& sight, double dt) noexcept {
  const double seen = depthSeen(sight);
  const double force = seen > -kSeatNear ? kSeatForce : kPushForce;
  const bool far = depth_ < -kNear && felt_ < 1.0;
  if (far) {
    const double ahead = -kNear - depth_;
    depth_ += dt * std::min({kFreeSpeed, kInsertSpeed + 4.0 * ahead, 0.05 + 0.5 * phase_time_});
  } else {
    depth_ += pushStep(force, felt_, kInsertSpeed, dt);
  }
  turnUpright(sight, dt);
  // what does not resist is not pushed beyond where it belongs
  if (felt_ < 0.5) depth_ = std::min(depth_, 0.0);
  depth_ = std::min(depth_, std::min(seen, 0.0) + kLongestPush);
  if (task_.sure_of_it && helped(sight)) {
    // led by another's hand she goes along
    const Vector3 sideways = sense.F_Ho_W.force + felt_ * axis_W_;
    const Vector3 lateral = sideways - sideways.dot(axis_W_) * axis_W_;
    if (lateral.norm() > 1.0) yieldTo(sight, 0.5, dt);
  }
  holdObject(sense, Vector3::Zero(), Quaternion::Identity(), dt);
  if (!task_.by_touch) {
    if (depth_ >= -1e-4) enter(Phase::kSeated);
    return;
  }
  const bool home = -seen < std::max(0.003, 1.5 * task_.tolerance);
  if (home && (stall_watch_.stalled(depthSeen(sight), 0.0005) || depth_ >= 0.0)) {
    enter(Phase::kSeated);
    return;
  }
  if (felt_ < 0.6 * force || task_.sure_of_it || !stall_watch_.stalled(depthSeen(sight), 0.001)) return;
  search_depth_ = seen;
  wiggle_ = {};
  enter(Phase::kSearch);
}

void AssemblySkill::search(const HandSense& sense, const DelayedSight& sight, double dt) noexcept {
  depth_ += pushStep(kSearchForce, felt_, 0.03, dt);
  turnUpright(sight, dt);
  depth_ = std::min(depth_, std::min(depthSeen(sight), 0.0) + kLongestPush);
  const bool near = depthSeen(sight) > search_depth_ + kDip;
  wiggle_.step(near, dt);
  comply(sight, kComply, dt);
  holdObject(sense, wiggle_.way(axis_W_), wiggle_.tilt(axis_W_), dt);

  const double seen = depthSeen(sight);
  if (seen > search_depth_ + 0.0025) {
    // it gave way: go on from here, as it lies in the hand now
    yieldTo(sight, 1.0 / dt, dt);
    carry_ = displacement(X_WAim_ * sense.X_HO.inverse(), X_WI_);
    carry_.translation -= nudge_.translation;
    carry_.translation -= axis_W_ * carry_.translation.dot(axis_W_);
    stall_watch_.start(seen);
    enter(Phase::kInsert);
  } else if (wiggle_.radius() > kSpiralWidest) {
    bias_scale_ *= 0.6;
    enter(Phase::kBackOff);
  }
}

void AssemblySkill::backOff(const HandSense& sense, const DelayedSight& sight, double dt) noexcept {
  const double out = search_depth_ - kBackOffWay;
  depth_ = std::max(out, depth_ - kInsertSpeed * dt);
  holdObject(sense, Vector3::Zero(), Quaternion::Identity(), dt);
  if (depth_ > out || phase_time_ < 1.0) return;
  aim();
  stall_watch_.start(depthSeen(sight));
  ++attempts_;
  enter(Phase::kInsert);
}

void AssemblySkill::seated(const HandSense& sense, const DelayedSight& sight, double dt) noexcept {
  back_out_W_ = -axis_W_ * std::max(0.15, task_.approach_distance);
  if (task_.by_touch) {
    depth_ += pushStep(kSeatForce, felt_, 0.03, dt);
    if (felt_ < 0.5) depth_ = std::min(depth_, 0.0);
    depth_ = std::min(depth_, kLongestPush);
    // held by its seat it needs no guiding: go limp sideways
    if (felt_ > 1.0) yieldTo(sight, 1.5, dt);
    holdObject(sense, Vector3::Zero(), Quaternion::Identity(), dt);
    const double patience = felt_ > 1.0 ? kPressedInVain : kWaitedInVain;
    if (sense.F_Ho_W.force.norm() > kHardlyFelt && phase_time_ > patience) {
      search_depth_ = depthSeen(sight);
      bias_scale_ *= 0.6;
      enter(Phase::kBackOff);
    }
    return;
  }
  // by sight: keep correcting
  const Displacement off = displacement(sight.pose(task_.object), X_WAim_);
  nudge_.translation += 1.0 * dt * off.translation;
  nudge_.rotation += 1.0 * dt * off.rotation;
  holdObject(sense, Vector3::Zero(), Quaternion::Identity(), dt);
}

void AssemblySkill::yieldTo(const DelayedSight& sight, double rate, double dt) noexcept {
  if (!sight.knows(task_.object)) return;
  X_WAim_ = yieldedTo(sight.pose(task_.object), X_WAim_, axis_W_, std::min(1.0, rate * dt));
  comply(sight, rate, dt);
}

void AssemblySkill::comply(const DelayedSight& sight, double rate, double dt) noexcept {
  if (!sight.knows(task_.object)) return;
  X_WAim_ = compliedWith(sight.pose(task_.object), X_WAim_, task_.X_WG, std::min(1.0, rate * dt));
}

bool AssemblySkill::helped(const DelayedSight& sight) const noexcept {
  if (!sight.knows(task_.helper) || !sight.knows(task_.object)) return false;
  const Vector3 p_OC =
      sight.pose(task_.object).inverse() * sight.pose(task_.helper).translation() - task_.centre;
  return (p_OC.cwiseAbs() - 0.5 * task_.size).cwiseMax(0.0).norm() < kHelped;
}

void AssemblySkill::turnUpright(const DelayedSight& sight, double dt) noexcept {
  if (!sight.knows(task_.object)) return;
  nudge_.rotation = uprightAgain(nudge_.rotation, sight.pose(task_.object), X_WAim_, dt);
}

void AssemblySkill::holdObject(const HandSense& sense, const Vector3& beside_W, const Quaternion& tilt,
                               double dt) noexcept {
  const Pose X_WO(X_WAim_.translation() + axis_W_ * depth_ + beside_W, tilt * X_WAim_.rotation());
  const Pose X_WH = displaced(displaced(X_WO * sense.X_HO.inverse(), nudge_), carry_);
  reach_.start(X_WH);
  reach_.stayWithin(sense.p_WC, sense.reach);
  setIntent(reach_.pose(), dt);
}

void AssemblySkill::setIntent(const Pose& X_WI, double dt) noexcept {
  const Displacement moved = displacement(X_WI_, X_WI);
  intent_velocity_ = {moved.translation / dt, moved.rotation / dt};
  // a decision is no motion: where the intent is put anew the arm does not hurry after it
  if (intent_velocity_.linear.norm() > 2.0 * person_.max_speed) intent_velocity_.linear.setZero();
  if (intent_velocity_.angular.norm() > 2.0 * person_.max_turn_speed) intent_velocity_.angular.setZero();
  X_WI_ = X_WI;
}

double AssemblySkill::depthSeen(const DelayedSight& sight) const noexcept {
  if (!sight.knows(task_.object)) return depth_;
  return (sight.pose(task_.object).translation() - X_WAim_.translation()).dot(axis_W_);
}

}  // namespace tenon
