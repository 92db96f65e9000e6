#include "server/session/exercise.h"

#include <algorithm>
#include <cstring>

#include "idl/types/bytes.h"

namespace tenon {
namespace {

/// A number of points; what is no number is no limit.
std::uint64_t pointsOf(double value) {
  constexpr double kMost = 1e15;
  return value > 0.0 ? static_cast<std::uint64_t>(std::min(value, kMost)) : 0;
}

}  // namespace

Exercise::Exercise(std::shared_ptr<const ScenarioFile> scenario, std::shared_ptr<const Scene> scene,
                   const ExerciseOptions& options)
    : scenario_(std::move(scenario)),
      environment_(std::move(scene), options.environment),
      machine_(scenario_),
      limits_(options.limits),
      needed_hands_(options.needed_hands),
      ages_(environment_.hands().size()) {}

void Exercise::tick(const TickInput& input) noexcept {
  for (const Change& change : input.changes) apply(change);
  read(input);
  judgeAges();
  if (phase_ == RunPhase::kRunning && !emergency_stop_) {
    machine_.step(environment_, {game_.begin(), game_.size()});
    if (machine_.status().finished) phase_ = RunPhase::kSucceeded;
    if (machine_.status().failed) phase_ = RunPhase::kFailed;
  }
  // what is commanded while all stand still is done when they go on
  if (!standsStill()) game_.clear();
  beginWhenAllAreHere();
  environment_.setStill(standsStill());
  environment_.step();
}

void Exercise::apply(const Change& change) noexcept {
  switch (change.kind) {
    case ChangeKind::kAttach:
      return attach(change.hand);
    case ChangeKind::kDetach:
      return detach(change.hand);
    case ChangeKind::kGame:
      game_.push_back(change.game);
      return;
    case ChangeKind::kRelease:
      return environment_.release(change.hand);
    case ChangeKind::kPair:
      return environment_.setPairEnabled(change.index, change.value != 0.0);
    case ChangeKind::kHalt:
      emergency_stop_ = change.value != 0.0;
      return;
    case ChangeKind::kContribute:
      return environment_.contribute(change.object, change.index, change.F_Oo_W, change.lifetime_ticks);
    case ChangeKind::kPlace:
      if (change.object.value >= environment_.objects().size()) return;
      return environment_.place(change.object, change.X_WO,
                                environment_.objects()[change.object.value].status);
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
      return environment_.setBudget(pointsOf(change.value));
  }
}

void Exercise::attach(HandId hand) noexcept {
  if (hand.value >= ages_.size()) return;
  ages_[hand.value] = {.attached = true, .active = true, .age = 0, .seq = 0};
}

void Exercise::detach(HandId hand) noexcept {
  if (hand.value >= ages_.size()) return;
  ages_[hand.value] = {};
  environment_.setHandPresent(hand, false);
}

void Exercise::read(const TickInput& input) noexcept {
  for (HandAge& age : ages_) ++age.age;
  for (const HandReading& reading : input.readings) {
    if (reading.hand.value >= ages_.size()) continue;
    HandAge& age = ages_[reading.hand.value];
    if (!age.attached) continue;
    age.age = 0;
    age.seq = reading.seq;
    age.active = reading.active;
    environment_.setHandPresent(reading.hand, true);
    environment_.setHandPose(reading.hand, reading.X_WH, reading.V_WH);
  }
}

void Exercise::judgeAges() noexcept {
  for (std::uint32_t i = 0; i < ages_.size(); ++i) {
    const HandAge& age = ages_[i];
    if (!age.attached) continue;
    if (age.age == limits_.park) environment_.setHandPresent(HandId{i}, false);
    environment_.setHandFrozen(HandId{i}, standsStill() || !age.active || age.age > limits_.freeze);
  }
}

void Exercise::beginWhenAllAreHere() noexcept {
  if (phase_ != RunPhase::kWaitingForPeople) return;
  const auto here = [&](HandId hand) { return environment_.hands()[hand.value].present; };
  if (!std::all_of(needed_hands_.begin(), needed_hands_.end(), here)) return;
  phase_ = RunPhase::kRunning;
  machine_.start(environment_);
}

std::uint64_t Exercise::hash() const noexcept {
  StateHash hash;
  hash.add(environment_.hash());
  machine_.addTo(hash);
  for (const HandAge& age : ages_) {
    hash.add(std::uint64_t{age.attached} | std::uint64_t{age.active} << 1U);
    hash.add(age.age);
  }
  hash.add(std::uint64_t{static_cast<std::uint32_t>(phase_)} | std::uint64_t{emergency_stop_} << 32U);
  for (const GameCommand& command : game_) {
    hash.add(std::uint64_t{static_cast<std::uint32_t>(command.kind)} | std::uint64_t{command.hand.value}
                                                                           << 32U);
    hash.add(std::uint64_t{command.signal});
    hash.add(command.value);
  }
  return hash.value();
}

TickOutput Exercise::makeOutput() const {
  TickOutput output;
  output.objects.resize(environment_.objects().size());
  output.manifolds.resize(environment_.hands().size());
  output.present.resize(environment_.hands().size());
  output.ages.resize(environment_.hands().size());
  output.pairs.reserve(environment_.contactRooms());
  return output;
}

void Exercise::fill(TickOutput& output) const noexcept {
  output.tick = now();
  output.hash = hash();
  output.phase = phase_;
  output.emergency_stop = emergency_stop_;
  output.step = machine_.status();

  const auto objects = environment_.objects();
  for (std::uint32_t i = 0; i < objects.size(); ++i) {
    const ObjectMotion& motion = objects[i];
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
    manifold.tick = output.tick;
    manifold.answers_seq = ages_[i].seq;
    manifold.step_revision = output.step.revision;
  }
  fillPairs(output);

  const Environment::Work& work = environment_.work();
  output.stats.tick = output.tick;
  output.stats.load_percent = work.load_percent;
  output.stats.active_pairs = work.active_pairs;
  output.stats.queried_pairs = work.queried_pairs;
  output.stats.points_visited = work.points_visited;
  output.stats.state_hash = output.hash;
}

void Exercise::fillPairs(TickOutput& output) const noexcept {
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
  output.pairs_in_turn.clear();
  if (output.tick % kHundredHertz != 0 || pairs.empty()) return;
  constexpr std::size_t kTurnsPerSecond = 100;
  const std::size_t count = std::min((pairs.size() + kTurnsPerSecond - 1) / kTurnsPerSecond, kPairsInTurn);
  const std::size_t first = output.tick / kHundredHertz * count;
  for (std::size_t i = 0; i < count; ++i) output.pairs_in_turn.push_back(stateOf((first + i) % pairs.size()));
}

void Exercise::save(std::vector<std::uint8_t>& bytes) const {
  ByteWriter out(bytes);
  // a part says its size first: known only once it is written
  const auto part = [&](const auto& saved) {
    const std::size_t at = bytes.size();
    out.put(std::uint32_t{0});
    saved.append(bytes);
    const auto size = static_cast<std::uint32_t>(bytes.size() - at - sizeof(std::uint32_t));
    std::memcpy(bytes.data() + at, &size, sizeof(size));
  };
  out.put(phase_), out.put(emergency_stop_);
  out.put(static_cast<std::uint32_t>(needed_hands_.size()));
  for (const HandId hand : needed_hands_) out.put(hand);
  for (const HandAge& age : ages_)
    out.put(age.attached), out.put(age.active), out.put(age.age), out.put(age.seq);
  out.put(static_cast<std::uint32_t>(game_.size()));
  for (const GameCommand& command : game_)
    out.put(command.kind), out.put(command.hand), out.put(command.signal), out.put(command.value);
  part(environment_);
  part(machine_);
}

std::size_t Exercise::mostSavedBytes() const {
  constexpr std::size_t kMostCommands = 2 * kMaxChanges * sizeof(GameCommand);
  std::vector<std::uint8_t> bytes;
  save(bytes);
  return environment_.mostSavedBytes() + bytes.size() + kMostCommands;
}

Result<void> Exercise::restore(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  in.get(phase_), in.get(emergency_stop_);
  std::uint32_t needed = 0;
  in.get(needed);
  if (needed > ages_.size()) return fail("a checkpoint in the journal is of another scenario");
  needed_hands_.resize(needed);
  for (HandId& hand : needed_hands_) {
    in.get(hand);
    if (hand.value >= ages_.size()) return fail("a checkpoint in the journal is of another scenario");
  }
  for (HandAge& age : ages_) in.get(age.attached), in.get(age.active), in.get(age.age), in.get(age.seq);
  std::uint32_t commands = 0;
  in.get(commands);
  if (commands > 2 * kMaxChanges) return fail("a checkpoint in the journal is damaged");
  game_.resize(commands);
  for (GameCommand& command : game_)
    in.get(command.kind), in.get(command.hand), in.get(command.signal), in.get(command.value);
  const auto part = [&](auto&& restoreFrom) -> Result<void> {
    std::uint32_t size = 0;
    in.get(size);
    const std::size_t at = in.position();
    if (!in.ok() || bytes.size() - at < size) return fail("a checkpoint in the journal is cut short");
    if (auto done = restoreFrom(bytes.subspan(at, size)); !done) return done;
    in.skip(size);
    return {};
  };
  if (auto done = part([&](auto span) { return environment_.restore(span); }); !done) return done;
  return part([&](auto span) { return machine_.restore(span); });
}

}  // namespace tenon
