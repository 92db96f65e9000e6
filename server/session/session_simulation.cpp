#include "server/session/session_simulation.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "idl/types/bytes.h"

namespace tenon::session {
namespace {

/// After this many ticks without a reading its velocity is published as zero. Of sparse inputs each tick has
/// a reading (ReadingPlayout); near the server so many are not lost in a row.
constexpr Tick kLateTicks = kMostInputPeriod;  // [ticks]

/// [points] of ChangeKind::kBudget; 0, no limit, for NaN and numbers below 1.
std::uint64_t budgetPoints(double value) {
  constexpr double kMaxPoints = 1e15;
  return value > 0.0 ? static_cast<std::uint64_t>(std::min(value, kMaxPoints)) : 0;
}

}  // namespace

SessionSimulation::SessionSimulation(std::shared_ptr<const game_control::ScenarioFile> scenario,
                                     std::shared_ptr<const simulation::Scene> scene,
                                     const SessionSimulationOptions& options)
    : scenario_(std::move(scenario)),
      environment_(std::move(scene), options.environment),
      machine_(scenario_),
      limits_(options.limits),
      needed_hands_(options.needed_hands),
      ages_(environment_.hands().size()),
      tracks_(environment_.hands().size()),
      collides_((environment_.pairs().size() + 7) / 8) {
  for (HandAge& age : ages_) age.limits = limits_;
}

void SessionSimulation::tick(const TickInput& input) noexcept {
  for (const Change& change : input.changes) apply(change);
  applyReadings(input);
  followExternalTracks();
  for (const Change& change : input.changes)
    if (change.kind == ChangeKind::kTake) take(change.hand, change.object);
  applyAgeLimits();
  if (stepsGoOn()) {
    const std::uint32_t ticks = phase_ == RunPhase::kPaused ? 0 : 1;
    dropFirstCommands(machine_.step(environment_, {commands_.begin(), commands_.size()}, ticks));
    if (machine_.status().finished) phase_ = RunPhase::kSucceeded;
    if (machine_.status().failed) phase_ = RunPhase::kFailed;
  }
  if (phase_ != RunPhase::kRunning && phase_ != RunPhase::kPaused) dropCommands();
  startWhenHandsPresent();
  environment_.setFreeBodiesPaused(isStill());
  environment_.step();
  if (collides_revision_ != environment_.pairRevision()) findCollisionMatrix();
}

void SessionSimulation::dropFirstCommands(std::size_t count) noexcept {
  std::copy(commands_.begin() + static_cast<std::ptrdiff_t>(count), commands_.end(), commands_.begin());
  commands_.resize(commands_.size() - count);
}

void SessionSimulation::dropCommands() noexcept {
  commands_dropped_ += commands_.size();
  commands_.clear();
}

void SessionSimulation::apply(const Change& change) noexcept {
  switch (change.kind) {
    case ChangeKind::kAttach:
      return attach(change.hand, change.stiffness);
    case ChangeKind::kDetach:
      return detach(change.hand);
    case ChangeKind::kGameCommand:
      if (emergency_stop_ || !commands_.push_back(change.game)) ++commands_dropped_;
      return;
    case ChangeKind::kRelease:
      return environment_.release(change.hand);
    case ChangeKind::kEnablePair:
      return environment_.setPairEnabled(change.index, change.value != 0.0);
    case ChangeKind::kSetEmergencyStop:
      // what was accepted just before would act, unseen, when the stop is cleared
      emergency_stop_ = change.value != 0.0;
      if (emergency_stop_) dropCommands();
      return;
    case ChangeKind::kFreezeForces:
      forces_frozen_ = change.value != 0.0;
      return;
    case ChangeKind::kContributeForce:
      return environment_.contribute(change.object, change.index, change.F_Oo_W, change.lifetime_ticks);
    case ChangeKind::kPlaceObject:
      return placeObject(change);
    case ChangeKind::kPause:
      if (phase_ == RunPhase::kRunning) phase_ = RunPhase::kPaused;
      return;
    case ChangeKind::kResume:
      if (phase_ == RunPhase::kPaused) phase_ = RunPhase::kRunning;
      return;
    case ChangeKind::kStop:
      if (!over()) phase_ = RunPhase::kStopped;
      return;
    case ChangeKind::kBudget:
      return environment_.setBudget(budgetPoints(change.value));
    case ChangeKind::kTake:
      return;  // when the readings of the tick are applied
    case ChangeKind::kContinue:
      for (std::uint32_t i = 0; i < ages_.size(); ++i) detach(HandId{i});
      return;
    case ChangeKind::kSetLimits:
      return setLimits(change);
  }
}

/// A pose of a tracked object counts for its lifetime; then the object's own tracker moves it again.
void SessionSimulation::placeObject(const Change& change) noexcept {
  if (change.object.value >= environment_.objects().size()) return;
  const HandId hand = trackedHandOf(change.object);
  if (!hand.valid())
    return environment_.place(change.object, change.X_WO, environment_.objects()[change.object.value].status);
  const Tick lifetime = std::clamp<Tick>(change.lifetime_ticks, 1, kMaxExternalPoseTicks);
  tracks_[hand.value] = {change.X_WO, now() + lifetime};
}

HandId SessionSimulation::trackedHandOf(ObjectId object) const noexcept {
  const auto hands = environment_.hands();
  for (std::uint32_t i = 0; i < hands.size(); ++i) {
    const bool tracked = environment_.scene().hands[i].kind == simulation::HandKind::kTracked;
    if (tracked && hands[i].present && hands[i].attached && hands[i].object == object) return HandId{i};
  }
  return {};
}

void SessionSimulation::followExternalTracks() noexcept {
  for (std::uint32_t i = 0; i < tracks_.size(); ++i) {
    const simulation::HandMotion& hand = environment_.hands()[i];
    if (!isTrackedElsewhere(i) || !hand.present || !hand.attached) continue;
    environment_.setHandPose(HandId{i}, tracks_[i].X_WO * hand.X_HO.inverse(), {});
  }
}

/// Before the hand has a pose, the object is hidden.
void SessionSimulation::take(HandId hand, ObjectId object) noexcept {
  if (hand.value >= ages_.size() || object.value >= environment_.objects().size()) return;
  const simulation::HandMotion& motion = environment_.hands()[hand.value];
  const bool is_there = motion.present && motion.has_pose;
  environment_.place(object, is_there ? motion.X_WH : environment_.objects()[object.value].X_WO,
                     is_there ? ObjectStatus::kParked : ObjectStatus::kHidden);
  environment_.grab(hand, object);
}

void SessionSimulation::attach(HandId hand, const HandStiffness& stiffness) noexcept {
  if (hand.value >= ages_.size()) return;
  environment_.setHandStiffness(hand, stiffness);
  ages_[hand.value] = {.attached = true, .active = true, .age = 0, .seq = 0, .limits = limits_};
}

void SessionSimulation::detach(HandId hand) noexcept {
  if (hand.value >= ages_.size()) return;
  ages_[hand.value] = {.limits = limits_};
  environment_.setHandPresent(hand, false);
}

/// Whoever asks: without an input no hand stays unfrozen for longer than kMostFreezeTicks.
void SessionSimulation::setLimits(const Change& change) noexcept {
  if (change.hand.value >= ages_.size() || !ages_[change.hand.value].attached) return;
  const Tick most_freeze = std::max<Tick>(limits_.freeze, kMostFreezeTicks);
  const Tick most_park = std::max<Tick>(limits_.park, kMostParkTicks);
  ages_[change.hand.value].limits = {std::clamp<Tick>(change.index, limits_.freeze, most_freeze),
                                     std::clamp<Tick>(change.lifetime_ticks, limits_.park, most_park)};
  environment_.setHandRoundTrip(change.hand, change.value);
}

void SessionSimulation::applyReadings(const TickInput& input) noexcept {
  for (HandAge& age : ages_) ++age.age;
  for (const HandReading& reading : input.readings) {
    if (reading.hand.value >= ages_.size()) continue;
    HandAge& age = ages_[reading.hand.value];
    if (!age.attached) continue;
    age.age = 0;
    age.seq = reading.seq;
    age.active = reading.active;
    environment_.setHandPresent(reading.hand, true);
    environment_.setHandPose(reading.hand, {reading.X_WH.translation(), reading.X_WH.rotation().normalized()},
                             reading.V_WH);
  }
}

void SessionSimulation::applyAgeLimits() noexcept {
  for (std::uint32_t i = 0; i < ages_.size(); ++i) {
    const HandAge& age = ages_[i];
    if (!age.attached) continue;
    if (age.age >= age.limits.park) environment_.setHandPresent(HandId{i}, false);
    const bool is_silent = !age.active || age.age > age.limits.freeze;
    environment_.setHandFrozen(HandId{i}, isStill() || (is_silent && !isTrackedElsewhere(i)));
  }
}

void SessionSimulation::startWhenHandsPresent() noexcept {
  if (phase_ != RunPhase::kWaitingForPeople) return;
  const auto present = [&](HandId hand) { return environment_.hands()[hand.value].present; };
  if (!std::all_of(needed_hands_.begin(), needed_hands_.end(), present)) return;
  phase_ = RunPhase::kRunning;
  machine_.start(environment_);
}

std::uint64_t SessionSimulation::hash() const noexcept {
  StateHash hash;
  hash.add(environment_.hash());
  machine_.addTo(hash);
  for (const HandAge& age : ages_) {
    hash.add(std::uint64_t{age.attached} | std::uint64_t{age.active} << 1U);
    hash.add(age.age);
    if (age.limits != limits_) hash.add(age.limits.freeze), hash.add(age.limits.park);
  }
  // nothing where there is none, as in most sessions
  for (std::uint32_t i = 0; i < tracks_.size(); ++i)
    if (isTrackedElsewhere(i))
      hash.add(std::uint64_t{i}), hash.add(tracks_[i].until), hash.add(tracks_[i].X_WO);
  hash.add(std::uint64_t{static_cast<std::uint32_t>(phase_)} | std::uint64_t{emergency_stop_} << 32U |
           std::uint64_t{forces_frozen_} << 33U);
  for (const game_control::GameCommand& command : commands_) {
    hash.add(std::uint64_t{static_cast<std::uint32_t>(command.kind)} | std::uint64_t{command.hand.value}
                                                                           << 32U);
    hash.add(std::uint64_t{command.signal});
    hash.add(command.value);
  }
  return hash.value();
}

TickOutput SessionSimulation::makeOutput() const {
  TickOutput output;
  output.objects.resize(environment_.objects().size());
  output.manifolds.resize(environment_.hands().size());
  output.present.resize(environment_.hands().size());
  output.ages.resize(environment_.hands().size());
  output.pairs.reserve(environment_.contactListCapacity());
  output.collides.resize(collides_.size());
  return output;
}

void SessionSimulation::fill(TickOutput& output) const noexcept {
  output.tick = now();
  output.hash = hash();
  output.phase = phase_;
  output.emergency_stop = emergency_stop_;
  output.forces_frozen = forces_frozen_;
  output.step = machine_.status();
  output.commands.waiting = commands_.size();
  output.commands.dropped = commands_dropped_;

  const auto objects = environment_.objects();
  for (std::uint32_t i = 0; i < objects.size(); ++i) {
    const simulation::ObjectMotion& motion = objects[i];
    ObjectState& state = output.objects[i];
    state.object = ObjectId{i};
    state.epoch = motion.epoch;
    state.X_WO = motion.X_WO;
    state.V_WO << motion.V_WO.linear.cast<float>(), motion.V_WO.angular.cast<float>();
    state.holder = motion.holder;
    state.status = static_cast<std::uint8_t>(motion.status);
    state.in_contact = motion.in_contact;
  }
  for (std::uint32_t i = 0; i < ages_.size(); ++i) {
    output.present[i] = environment_.hands()[i].present;
    output.ages[i] = static_cast<std::uint32_t>(std::min<Tick>(ages_[i].age, 0xFFFFFFFFU));
    if (!output.present[i]) continue;
    HandManifold& manifold = output.manifolds[i];
    environment_.manifold(HandId{i}, manifold);
    // the goal of a hand whose inputs do not come stands still: it is not expected to go on
    for (HandPull& pull : manifold.others)
      if (pull.hand.value < ages_.size() && ages_[pull.hand.value].age > kLateTicks) pull.V_WG.setZero();
    manifold.tick = output.tick;
    manifold.answers_seq = ages_[i].seq;
    manifold.step_revision = output.step.revision;
  }
  fillPairs(output);
  std::copy(collides_.begin(), collides_.end(), output.collides.begin());

  const simulation::Environment::Work& work = environment_.work();
  output.stats.tick = output.tick;
  output.stats.load_percent = work.load_percent;
  output.stats.active_pairs = work.active_pairs;
  output.stats.queried_pairs = work.queried_pairs;
  output.stats.points_visited = work.points_visited;
  output.stats.state_hash = output.hash;
}

void SessionSimulation::findCollisionMatrix() noexcept {
  collides_revision_ = environment_.pairRevision();
  std::fill(collides_.begin(), collides_.end(), std::uint8_t{0});
  const auto pairs = environment_.pairs();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const simulation::PairSpec& spec = environment_.scene().pairs[i];
    const std::uint32_t group = environment_.groupOf(spec.a);
    const bool in_one_group = group != 0 && group == environment_.groupOf(spec.b);
    if (pairs[i].enabled && !in_one_group)
      collides_[i / 8] = static_cast<std::uint8_t>(collides_[i / 8] | 1U << (i % 8));
  }
}

void SessionSimulation::fillPairs(TickOutput& output) const noexcept {
  const auto stateOf = [this](std::size_t pair) {
    PairState state{static_cast<std::uint32_t>(pair), {}};
    environment_.pairContact(pair, state.contact);
    return state;
  };
  output.pairs.clear();
  const auto pairs = environment_.pairs();
  for (const std::uint32_t pair : environment_.nearPairs()) {
    if (pairs[pair].result != nullptr) output.pairs.push_back(stateOf(pair));
  }
  output.round_robin_pairs.clear();
  if (output.tick % kPeriod100Hz != 0 || pairs.empty()) return;
  constexpr std::size_t kSamplesPerSecond = 100;
  const std::size_t count =
      std::min((pairs.size() + kSamplesPerSecond - 1) / kSamplesPerSecond, kRoundRobinPairs);
  const std::size_t first = output.tick / kPeriod100Hz * count;
  for (std::size_t i = 0; i < count; ++i)
    output.round_robin_pairs.push_back(stateOf((first + i) % pairs.size()));
}

void SessionSimulation::save(std::vector<std::uint8_t>& bytes) const {
  ByteWriter out(bytes);
  // each section is preceded by its size, which is known only once it is written
  const auto section = [&](const auto& saved) {
    const std::size_t at = bytes.size();
    out.put(std::uint32_t{0});
    saved.append(bytes);
    const auto size = static_cast<std::uint32_t>(bytes.size() - at - sizeof(std::uint32_t));
    std::memcpy(bytes.data() + at, &size, sizeof(size));
  };
  out.put(phase_), out.put(emergency_stop_), out.put(forces_frozen_);
  out.put(static_cast<std::uint32_t>(needed_hands_.size()));
  for (const HandId hand : needed_hands_) out.put(hand);
  for (const HandAge& age : ages_) {
    out.put(age.attached), out.put(age.active), out.put(age.age), out.put(age.seq);
    out.put(age.limits.freeze), out.put(age.limits.park);
  }
  for (const ExternalTrack& track : tracks_) out.put(track.X_WO), out.put(track.until);
  out.put(static_cast<std::uint32_t>(commands_.size()));
  for (const game_control::GameCommand& command : commands_)
    out.put(command.kind), out.put(command.hand), out.put(command.signal), out.put(command.value);
  section(environment_);
  section(machine_);
}

std::size_t SessionSimulation::maxSavedBytes() const {
  constexpr std::size_t kMostCommandBytes = kMostWaitingCommands * sizeof(game_control::GameCommand);
  std::vector<std::uint8_t> bytes;
  save(bytes);
  return environment_.maxSavedBytes() + bytes.size() + kMostCommandBytes;
}

Result<void> SessionSimulation::restore(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  in.get(phase_), in.get(emergency_stop_), in.get(forces_frozen_);
  std::uint32_t needed = 0;
  in.get(needed);
  if (needed > ages_.size()) return fail("a checkpoint in the journal is of another scenario");
  needed_hands_.resize(needed);
  for (HandId& hand : needed_hands_) {
    in.get(hand);
    if (hand.value >= ages_.size()) return fail("a checkpoint in the journal is of another scenario");
  }
  for (HandAge& age : ages_) {
    in.get(age.attached), in.get(age.active), in.get(age.age), in.get(age.seq);
    in.get(age.limits.freeze), in.get(age.limits.park);
  }
  for (ExternalTrack& track : tracks_) in.get(track.X_WO), in.get(track.until);
  std::uint32_t commands = 0;
  in.get(commands);
  if (commands > kMostWaitingCommands) return fail("a checkpoint in the journal is damaged");
  commands_.resize(commands);
  for (game_control::GameCommand& command : commands_)
    in.get(command.kind), in.get(command.hand), in.get(command.signal), in.get(command.value);
  const auto finite = [](const game_control::GameCommand& command) { return std::isfinite(command.value); };
  const auto isPlaced = [](const ExternalTrack& track) { return track.X_WO.isFinite(); };
  if (phase_ > RunPhase::kStopped || !std::all_of(commands_.begin(), commands_.end(), finite) ||
      !std::all_of(tracks_.begin(), tracks_.end(), isPlaced))
    return fail("a checkpoint in the journal is damaged");
  const auto section = [&](auto&& restoreFrom) -> Result<void> {
    std::uint32_t size = 0;
    in.get(size);
    const std::size_t at = in.position();
    if (!in.ok() || bytes.size() - at < size) return fail("a checkpoint in the journal is truncated");
    if (auto done = restoreFrom(bytes.subspan(at, size)); !done) return done;
    in.skip(size);
    return {};
  };
  if (auto done = section([&](auto span) { return environment_.restore(span); }); !done) return done;
  if (auto done = section([&](auto span) { return machine_.restore(span); }); !done) return done;
  if (!in.atEnd()) return fail("a checkpoint in the journal is followed by other bytes");
  return {};
}

}  // namespace tenon::session
