#include "server/session/front_desk.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "idl/types/names.h"

namespace tenon {
namespace {

constexpr double kFarthest = 1000.0;     // [m] no station is farther from the scene than this
constexpr double kFastest = 50.0;        // [m/s], [rad/s] no hand is faster than this
constexpr double kLargestForce = 200.0;  // [N], [Nm] of a contribution from outside
constexpr std::uint32_t kLongestLifetime = 100;

bool isSane(const Pose& X) {
  return X.isFinite() && X.translation().cwiseAbs().maxCoeff() < kFarthest &&
         std::abs(X.rotation().squaredNorm() - 1.0) < 1e-3;
}

bool isSane(const Vector3& v, double limit) { return v.allFinite() && v.norm() < limit; }

bool mayMoveHandOf(Role role, Role hand_role) { return role == hand_role || role == Role::kAdmin; }

bool isTeacher(Role role) { return role == Role::kInstructor || role == Role::kAdmin; }

}  // namespace

FrontDesk::FrontDesk(const ScenarioFile& scenario, std::uint32_t server_epoch, bool lockstep,
                     std::uint64_t seed)
    : scenario_(scenario),
      server_epoch_(server_epoch),
      lockstep_(lockstep),
      random_(seed),
      movers_(scenario.hands.size()) {}

const Presence* FrontDesk::person(ClientId client) const {
  const bool known = client.value >= 1 && client.value <= people_.size();
  return known ? &people_[client.value - 1] : nullptr;
}

bool FrontDesk::roleIsHere(Role role) const {
  return std::any_of(people_.begin(), people_.end(),
                     [&](const Presence& person) { return person.alive && person.role == role; });
}

bool FrontDesk::someoneMovesAHand() const {
  return std::any_of(movers_.begin(), movers_.end(), [](ClientId mover) { return mover.valid(); });
}

std::vector<std::string> FrontDesk::freeHands() const {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < movers_.size(); ++i)
    if (!movers_[i].valid()) names.push_back(scenario_.hands[i].name);
  return names;
}

std::string FrontDesk::refusal(const Join& join) const {
  if (join.protocol_version != kProtocolVersion)
    return fmt::format("this server speaks protocol version {}, the client {}: update the older one",
                       kProtocolVersion, join.protocol_version);
  if (join.role > Role::kRecorder) return "unknown role";
  if (join.client_guid.empty()) return "a client needs a name of its own (client_guid) to be answered";
  for (const std::string& name : join.hands) {
    const HandId hand = scenario_.handNamed(name);
    if (!hand.valid()) continue;  // a station may offer more hands than a scenario uses
    const Role owner = scenario_.hands[hand.value].role;
    if (!mayMoveHandOf(join.role, owner))
      return fmt::format("hand '{}' belongs to the {}, not to the {}", name, roleName(owner),
                         roleName(join.role));
    if (movers_[hand.value].valid()) return fmt::format("hand '{}' is already moved by somebody else", name);
  }
  return {};
}

bool FrontDesk::isFrom(ClientId client, const Origin& origin) const {
  return person(client) != nullptr && seats_[client.value - 1].origin == origin;
}

Welcome FrontDesk::join(const Join& join, Tick now, const Origin& from) {
  Welcome welcome;
  welcome.client_guid = join.client_guid;
  welcome.server_epoch = server_epoch_;
  welcome.lockstep = lockstep_;
  welcome.tick = now;

  // the same question again, because the answer was lost: the same answer
  for (Seat& seat : seats_) {
    if (seat.guid.empty() || seat.guid != join.client_guid || !person(seat.welcome.client)->alive) continue;
    seat.welcome.tick = now;
    return seat.welcome;
  }

  // somebody comes back
  for (std::size_t i = 0; i < seats_.size(); ++i) {
    if (join.token.empty() || seats_[i].token != join.token) continue;
    if (people_[i].alive) leave(people_[i].client);
  }
  welcome.reason = refusal(join);
  if (welcome.reason.empty()) seat(join, welcome, from);
  return welcome;
}

void FrontDesk::seat(const Join& join, Welcome& welcome, const Origin& from) {
  const auto former = std::find_if(seats_.begin(), seats_.end(), [&](const Seat& seat) {
    return !join.token.empty() && seat.token == join.token;
  });
  const std::size_t place = static_cast<std::size_t>(former - seats_.begin());
  if (former == seats_.end()) {
    people_.emplace_back();
    seats_.push_back({join.client_guid, fmt::format("{:016x}", random_()), {}, {}, {}});
  }
  welcome.accepted = true;
  welcome.client = ClientId{static_cast<std::uint32_t>(place + 1)};
  std::vector<HandId> given;
  for (const std::string& name : join.hands) {
    const HandId hand = scenario_.handNamed(name);
    welcome.hands.push_back(hand);
    if (!hand.valid()) continue;
    movers_[hand.value] = welcome.client;
    given.push_back(hand);
    changes_.push_back({.kind = ChangeKind::kAttach, .hand = hand});
  }
  welcome.token = seats_[place].token;
  people_[place] = {welcome.client, join.name, join.role, given, true};
  seats_[place].guid = join.client_guid;
  seats_[place].welcome = welcome;
  seats_[place].origin = from;
  seats_[place].answer = {};
}

void FrontDesk::leave(ClientId client) {
  if (person(client) == nullptr) return;
  Presence& who = people_[client.value - 1];
  who.alive = false;
  for (std::uint32_t i = 0; i < movers_.size(); ++i) {
    if (movers_[i] != client) continue;
    movers_[i] = {};
    changes_.push_back({.kind = ChangeKind::kDetach, .hand = HandId{i}});
  }
}

void FrontDesk::emergencyStop(const EmergencyStop& stop) {
  halted_ = stop.engaged;
  changes_.push_back({.kind = ChangeKind::kHalt, .value = stop.engaged ? 1.0 : 0.0});
}

bool FrontDesk::isMover(ClientId client, HandId hand) const {
  return hand.value < movers_.size() && client.valid() && movers_[hand.value] == client;
}

Result<HandReading> FrontDesk::reading(const DeviceInput& input) const {
  if (input.server_epoch != server_epoch_) return fail("an input meant for an earlier run of the server");
  if (input.hand.value >= movers_.size())
    return fail(fmt::format("client {} sent input for hand {}, which this scenario does not have",
                            input.client.value, input.hand.value));
  const std::string& name = scenario_.hands[input.hand.value].name;
  if (!isMover(input.client, input.hand))
    return fail(
        fmt::format("client {} sent input for hand '{}', which is not its own", input.client.value, name));
  const DeviceSample& newest = input.samples[0];
  if (!isSane(newest.X_WH) || !isSane(newest.V_WH.linear, kFastest) || !isSane(newest.V_WH.angular, kFastest))
    return fail(fmt::format("client {} sent a pose of hand '{}' that is not a pose: ignored",
                            input.client.value, name));
  return HandReading{input.hand, newest.seq, input.active, newest.X_WH, newest.V_WH, newest.buttons};
}

Result<Change> FrontDesk::contribution(const ForceContribution& force) const {
  const Presence* who = person(force.client);
  if (who == nullptr || !who->alive || who->role == Role::kObserver || who->role == Role::kRecorder)
    return fail(fmt::format("client {} may not contribute forces", force.client.value));
  if (force.object.value >= scenario_.objects.size())
    return fail(fmt::format("client {} sent a force for an unknown object", force.client.value));
  if (!isSane(force.F_Oo_W.force, kLargestForce) || !isSane(force.F_Oo_W.torque, kLargestForce))
    return fail(fmt::format("client {} sent a force that is not finite or above {} N", force.client.value,
                            kLargestForce));
  return Change{.kind = ChangeKind::kContribute,
                .object = force.object,
                .index = force.source,
                .lifetime_ticks = std::min(force.lifetime_ticks, kLongestLifetime),
                .F_Oo_W = force.F_Oo_W};
}

Result<Change> FrontDesk::externalPose(const ExternalPose& pose) const {
  const Presence* who = person(pose.client);
  if (who == nullptr || !who->alive || !isTeacher(who->role))
    return fail(fmt::format("client {} may not place objects", pose.client.value));
  if (pose.object.value >= scenario_.objects.size() || !isSane(pose.X_WO))
    return fail(
        fmt::format("client {} sent a pose for an object that is unknown or no pose", pose.client.value));
  return Change{.kind = ChangeKind::kPlace, .object = pose.object, .X_WO = pose.X_WO};
}

void FrontDesk::follow(RunPhase phase, bool emergency_stop) {
  phase_ = phase;
  const bool goes_on = phase == RunPhase::kRunning || phase == RunPhase::kPaused;
  if (decided_ == phase || !goes_on) decided_.reset();
  if (comingPhase() != RunPhase::kPaused && !emergency_stop) held_back_ = 0;
}

CommandAck FrontDesk::command(const Command& command) {
  const Presence* who = person(command.client);
  if (who == nullptr || !who->alive) return {command.client, command.id, false, "join first"};
  CommandAck ack = decide(command, who->role);
  seats_[command.client.value - 1].answer = ack;
  return ack;
}

const CommandAck* FrontDesk::answerTo(const Command& command) const {
  const Presence* who = person(command.client);
  if (who == nullptr || !who->alive) return nullptr;
  const CommandAck& answer = seats_[command.client.value - 1].answer;
  return answer.id == command.id && command.id != 0 ? &answer : nullptr;
}

CommandAck FrontDesk::decide(const Command& command, Role role) {
  CommandAck ack{command.client, command.id, false, {}};
  const auto change = changeFor(command, role);
  ack.reason = change ? untimely(command.kind) : change.error().what;
  ack.accepted = ack.reason.empty();
  if (!ack.accepted) return ack;
  const bool stands_still = comingPhase() == RunPhase::kPaused || halted_;
  if (change->kind == ChangeKind::kGame && stands_still) ++held_back_;
  if (change->kind == ChangeKind::kPause) decided_ = RunPhase::kPaused;
  if (change->kind == ChangeKind::kResume) decided_ = RunPhase::kRunning;
  if (change->kind == ChangeKind::kHalt) halted_ = false;
  stop_asked_ = stop_asked_ || change->kind == ChangeKind::kStop;
  changes_.push_back(*change);
  return ack;
}

/// Why the run cannot do this now, whoever asks; empty: it can. An accepted command is never lost.
std::string FrontDesk::untimely(CommandKind kind) const {
  const bool for_any_time = kind == CommandKind::kRelease || kind == CommandKind::kSetCollision ||
                            kind == CommandKind::kStop || kind == CommandKind::kClearEmergencyStop;
  if (phase_ >= RunPhase::kSucceeded) return "the run is over";
  if (for_any_time) return {};
  if (phase_ == RunPhase::kWaitingForPeople)
    return "the session still waits for people: ask again once it runs";
  if (kind == CommandKind::kResume)
    return comingPhase() == RunPhase::kPaused ? "" : "the session is not paused";
  if (kind == CommandKind::kPause)
    return comingPhase() == RunPhase::kPaused ? "the session is paused already" : "";
  if (held_back_ >= kMaxChanges)
    return fmt::format("{} commands wait already for the session to go on", held_back_);
  return {};
}

int FrontDesk::pairNamed(std::string_view a, std::string_view b) const {
  const ObjectId object_a = scenario_.objectNamed(a);
  const ObjectId object_b = scenario_.objectNamed(b);
  return object_a.valid() && object_b.valid() ? scenario_.pairOf(object_a, object_b) : -1;
}

/// Every hand that feels what it moves, of the trainee.
bool FrontDesk::movesBothHands(ClientId client) const {
  for (std::uint32_t i = 0; i < movers_.size(); ++i) {
    const ScenarioHand& hand = scenario_.hands[i];
    const bool swaps = hand.role == Role::kTrainee && hand.kind == HandKind::kCoupled;
    if (swaps && !isMover(client, HandId{i})) return false;
  }
  return true;
}

namespace {

Change gameChange(const Command& command, std::uint32_t signal = 0) {
  Change change{.kind = ChangeKind::kGame};
  change.game = {command.kind, command.hand, signal, command.value};
  return change;
}

}  // namespace

Result<Change> FrontDesk::changeFor(const Command& command, Role role) const {
  const auto not_for = [&] {
    return fail(fmt::format("not for the {}: ask the instructor", roleName(role)));
  };
  if (role == Role::kObserver || role == Role::kRecorder) return not_for();
  switch (command.kind) {
    case CommandKind::kFulfilled:
      return gameChange(command);
    case CommandKind::kSignal: {
      const int signal = scenario_.signalNamed(command.text);
      if (signal < 0) return fail(fmt::format("this scenario listens to no signal '{}'", command.text));
      return gameChange(command, static_cast<std::uint32_t>(signal));
    }
    case CommandKind::kRelease:
      return releaseOf(command, role);
    case CommandKind::kSwapHands:
      if (!isTeacher(role) && !movesBothHands(command.client)) return fail("those are not your hands");
      return gameChange(command);
    default:
      if (!isTeacher(role)) return not_for();
      return teachersChange(command);
  }
}

Result<Change> FrontDesk::releaseOf(const Command& command, Role role) const {
  const HandId hand = command.hand.valid() ? command.hand : scenario_.handNamed(command.text);
  if (!isTeacher(role) && !isMover(command.client, hand)) return fail("that is not your hand");
  if (hand.value >= movers_.size())
    return fail(command.text.empty() ? "there is no such hand"
                                     : fmt::format("this scenario has no hand '{}'", command.text));
  return Change{.kind = ChangeKind::kRelease, .hand = hand};
}

Result<Change> FrontDesk::teachersChange(const Command& command) const {
  switch (command.kind) {
    case CommandKind::kPause:
      return Change{.kind = ChangeKind::kPause};
    case CommandKind::kResume:
      return Change{.kind = ChangeKind::kResume};
    case CommandKind::kStop:
      return Change{.kind = ChangeKind::kStop};
    case CommandKind::kClearEmergencyStop:
      if (!halted_) return fail("there is no emergency stop");
      return Change{.kind = ChangeKind::kHalt, .value = 0.0};
    case CommandKind::kReset:
    case CommandKind::kSkipStep:
      return gameChange(command);
    case CommandKind::kSetCollision: {
      const std::size_t space = command.text.find(' ');
      const int pair = space == std::string::npos
                           ? -1
                           : pairNamed(command.text.substr(0, space), command.text.substr(space + 1));
      if (pair < 0) return fail(fmt::format("'{}' are not two objects that may touch", command.text));
      return Change{
          .kind = ChangeKind::kPair, .index = static_cast<std::uint32_t>(pair), .value = command.value};
    }
    default:
      return fail("unknown command");
  }
}

void FrontDesk::takeChanges(FixedVector<Change, kMaxChanges>& out) {
  std::size_t taken = 0;
  while (taken < changes_.size() && out.push_back(changes_[taken])) ++taken;
  changes_.erase(changes_.begin(), changes_.begin() + static_cast<std::ptrdiff_t>(taken));
}

}  // namespace tenon
