#include "server/session/session_registry.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "idl/types/names.h"

namespace tenon::session {
namespace {

constexpr double kMaxPosition = 1000.0;  // [m] of a hand or object from the world's origin, each axis
constexpr double kMaxSpeed = 50.0;       // [m/s], [rad/s] of a hand

bool isPlausible(const Pose& X) {
  return X.isFinite() && X.translation().cwiseAbs().maxCoeff() < kMaxPosition &&
         std::abs(X.rotation().squaredNorm() - 1.0) < 1e-3;
}

bool isPlausible(const Vector3& v, double limit) { return v.allFinite() && v.norm() < limit; }

bool mayControlHandOf(Role role, Role hand_role) { return role == hand_role || role == Role::kAdmin; }

bool hasInstructorRights(Role role) { return role == Role::kInstructor || role == Role::kAdmin; }

}  // namespace

SessionRegistry::SessionRegistry(const game_control::ScenarioFile& scenario, std::uint32_t server_epoch,
                                 bool lockstep, std::uint64_t seed)
    : scenario_(scenario),
      server_epoch_(server_epoch),
      lockstep_(lockstep),
      random_(seed),
      controllers_(scenario.hands.size()) {}

const Presence* SessionRegistry::findClient(ClientId client) const {
  const bool known = client.value >= 1 && client.value <= clients_.size();
  return known ? &clients_[client.value - 1] : nullptr;
}

bool SessionRegistry::isRolePresent(Role role) const {
  return std::any_of(clients_.begin(), clients_.end(),
                     [&](const Presence& person) { return person.alive && person.role == role; });
}

bool SessionRegistry::anyHandControlled() const {
  return std::any_of(controllers_.begin(), controllers_.end(),
                     [](ClientId controller) { return controller.valid(); });
}

std::vector<std::string> SessionRegistry::freeHands() const {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < controllers_.size(); ++i)
    if (!controllers_[i].valid()) names.push_back(scenario_.hands[i].name);
  return names;
}

std::string SessionRegistry::joinRefusal(const Join& join) const {
  if (join.protocol_version != kProtocolVersion)
    return fmt::format("the server has protocol version {}, the client {}: update the older one",
                       kProtocolVersion, join.protocol_version);
  if (join.role > Role::kRecorder) return "unknown role";
  if (join.client_guid.empty())
    return "the join request has no client_guid: the answer could not be addressed";
  for (const std::string& name : join.hands) {
    const HandId hand = scenario_.handNamed(name);
    if (!hand.valid()) continue;  // a station may offer more hands than the scenario has
    const Role owner = scenario_.hands[hand.value].role;
    if (!mayControlHandOf(join.role, owner))
      return fmt::format("hand '{}' belongs to the {}, not to the {}", name, roleName(owner),
                         roleName(join.role));
    if (controllers_[hand.value].valid())
      return fmt::format("hand '{}' is already moved by somebody else", name);
  }
  return {};
}

bool SessionRegistry::ownsSeat(ClientId client, const wire::Origin& origin) const {
  return findClient(client) != nullptr && seats_[client.value - 1].origin == origin;
}

Welcome SessionRegistry::join(const Join& join, Tick now, const wire::Origin& from) {
  Welcome welcome;
  welcome.client_guid = join.client_guid;
  welcome.server_epoch = server_epoch_;
  welcome.lockstep = lockstep_;
  welcome.tick = now;

  // a repeated request, because its answer was lost, gets the same answer
  for (Seat& seat : seats_) {
    if (seat.guid.empty() || seat.guid != join.client_guid || !findClient(seat.welcome.client)->alive)
      continue;
    seat.welcome.tick = now;
    return seat.welcome;
  }

  // the token of a seat that is still taken: its former program ended unnoticed
  for (std::size_t i = 0; i < seats_.size(); ++i) {
    if (join.token.empty() || seats_[i].token != join.token) continue;
    if (clients_[i].alive) leave(clients_[i].client);
  }
  welcome.reason = joinRefusal(join);
  if (welcome.reason.empty()) assignSeat(join, welcome, from);
  return welcome;
}

void SessionRegistry::assignSeat(const Join& join, Welcome& welcome, const wire::Origin& from) {
  const auto former = std::find_if(seats_.begin(), seats_.end(), [&](const Seat& seat) {
    return !join.token.empty() && seat.token == join.token;
  });
  const std::size_t index = static_cast<std::size_t>(former - seats_.begin());
  if (former == seats_.end()) {
    clients_.emplace_back();
    seats_.push_back({join.client_guid, fmt::format("{:016x}", random_()), {}, {}, {}});
  }
  welcome.accepted = true;
  welcome.client = ClientId{static_cast<std::uint32_t>(index + 1)};
  std::vector<HandId> controlled;
  for (const std::string& name : join.hands) {
    const HandId hand = scenario_.handNamed(name);
    welcome.hands.push_back(hand);
    if (!hand.valid()) continue;
    controllers_[hand.value] = welcome.client;
    controlled.push_back(hand);
    changes_.push_back({.kind = ChangeKind::kAttach, .hand = hand});
  }
  welcome.token = seats_[index].token;
  clients_[index] = {welcome.client, join.name, join.role, controlled, true};
  seats_[index].guid = join.client_guid;
  seats_[index].welcome = welcome;
  seats_[index].origin = from;
  seats_[index].last_ack = {};
}

void SessionRegistry::leave(ClientId client) {
  if (findClient(client) == nullptr) return;
  Presence& who = clients_[client.value - 1];
  who.alive = false;
  for (std::uint32_t i = 0; i < controllers_.size(); ++i) {
    if (controllers_[i] != client) continue;
    controllers_[i] = {};
    changes_.push_back({.kind = ChangeKind::kDetach, .hand = HandId{i}});
  }
}

void SessionRegistry::setEmergencyStop(const EmergencyStop& stop) {
  emergency_stop_ = stop.engaged;
  changes_.push_back({.kind = ChangeKind::kSetEmergencyStop, .value = stop.engaged ? 1.0 : 0.0});
}

bool SessionRegistry::isController(ClientId client, HandId hand) const {
  return hand.value < controllers_.size() && client.valid() && controllers_[hand.value] == client;
}

Result<HandReading> SessionRegistry::validateDeviceInput(const DeviceInput& input) const {
  if (input.server_epoch != server_epoch_) return fail("input for an earlier run of the server");
  if (input.hand.value >= controllers_.size())
    return fail(fmt::format("client {} sent input for hand {}, which this scenario does not have",
                            input.client.value, input.hand.value));
  const std::string& name = scenario_.hands[input.hand.value].name;
  if (!isController(input.client, input.hand))
    return fail(
        fmt::format("client {} sent input for hand '{}', which is not its own", input.client.value, name));
  const DeviceSample& newest = input.samples[0];
  if (!isPlausible(newest.X_WH) || !isPlausible(newest.V_WH.linear, kMaxSpeed) ||
      !isPlausible(newest.V_WH.angular, kMaxSpeed))
    return fail(fmt::format("client {} sent an implausible pose or velocity of hand '{}': ignored",
                            input.client.value, name));
  return HandReading{input.hand, newest.seq, input.active, newest.X_WH, newest.V_WH, newest.buttons};
}

Result<Change> SessionRegistry::validateForceContribution(const ForceContribution& force) const {
  const Presence* who = findClient(force.client);
  if (who == nullptr || !who->alive || who->role == Role::kObserver || who->role == Role::kRecorder)
    return fail(fmt::format("client {} may not contribute forces", force.client.value));
  if (force.object.value >= scenario_.objects.size())
    return fail(fmt::format("client {} sent a force for an unknown object", force.client.value));
  if (!force.F_Oo_W.force.allFinite() || !force.F_Oo_W.torque.allFinite())
    return fail(fmt::format("client {} sent a force that is not finite", force.client.value));
  return Change{.kind = ChangeKind::kContributeForce,
                .object = force.object,
                .index = force.source,
                .lifetime_ticks = force.lifetime_ticks,
                .F_Oo_W = force.F_Oo_W};
}

Result<Change> SessionRegistry::validateExternalPose(const ExternalPose& pose) const {
  const Presence* who = findClient(pose.client);
  if (who == nullptr || !who->alive || !hasInstructorRights(who->role))
    return fail(fmt::format("client {} may not place objects", pose.client.value));
  if (pose.object.value >= scenario_.objects.size() || !isPlausible(pose.X_WO))
    return fail(
        fmt::format("client {} sent an implausible pose or one of an unknown object", pose.client.value));
  return Change{.kind = ChangeKind::kPlaceObject, .object = pose.object, .X_WO = pose.X_WO};
}

void SessionRegistry::updatePhase(RunPhase phase, bool emergency_stop) {
  phase_ = phase;
  const bool active = phase == RunPhase::kRunning || phase == RunPhase::kPaused;
  if (pending_phase_ == phase || !active) pending_phase_.reset();
  if (expectedPhase() != RunPhase::kPaused && !emergency_stop) deferred_commands_ = 0;
}

CommandAck SessionRegistry::handleCommand(const Command& command) {
  const Presence* who = findClient(command.client);
  if (who == nullptr || !who->alive) return {command.client, command.id, false, "join first"};
  CommandAck ack = decide(command, who->role);
  seats_[command.client.value - 1].last_ack = ack;
  return ack;
}

const CommandAck* SessionRegistry::previousAck(const Command& command) const {
  const Presence* who = findClient(command.client);
  if (who == nullptr || !who->alive) return nullptr;
  const CommandAck& ack = seats_[command.client.value - 1].last_ack;
  return ack.id == command.id && command.id != 0 ? &ack : nullptr;
}

CommandAck SessionRegistry::decide(const Command& command, Role role) {
  CommandAck ack{command.client, command.id, false, {}};
  const auto change = changeFromCommand(command, role);
  ack.reason = change ? refusalByPhase(command.kind) : change.error().what;
  ack.accepted = ack.reason.empty();
  if (!ack.accepted) return ack;
  const bool suspended = expectedPhase() == RunPhase::kPaused || emergency_stop_;
  if (change->kind == ChangeKind::kGameCommand && suspended) ++deferred_commands_;
  if (change->kind == ChangeKind::kPause) pending_phase_ = RunPhase::kPaused;
  if (change->kind == ChangeKind::kResume) pending_phase_ = RunPhase::kRunning;
  if (change->kind == ChangeKind::kSetEmergencyStop) emergency_stop_ = false;
  stop_requested_ = stop_requested_ || change->kind == ChangeKind::kStop;
  changes_.push_back(*change);
  return ack;
}

/// Why the command cannot take effect in the current phase, for any role; empty: it can. A command is only
/// accepted when it will take effect.
std::string SessionRegistry::refusalByPhase(CommandKind kind) const {
  const bool in_any_phase = kind == CommandKind::kRelease || kind == CommandKind::kSetCollision ||
                            kind == CommandKind::kStop || kind == CommandKind::kClearEmergencyStop;
  if (phase_ >= RunPhase::kSucceeded) return "the run is over";
  if (in_any_phase) return {};
  if (phase_ == RunPhase::kWaitingForPeople)
    return "the session still waits for people: repeat the command once it runs";
  if (kind == CommandKind::kResume)
    return expectedPhase() == RunPhase::kPaused ? "" : "the session is not paused";
  if (kind == CommandKind::kPause)
    return expectedPhase() == RunPhase::kPaused ? "the session is paused already" : "";
  if (deferred_commands_ >= kMaxChanges)
    return fmt::format("{} commands wait already until the session continues", deferred_commands_);
  return {};
}

int SessionRegistry::findPair(std::string_view a, std::string_view b) const {
  const ObjectId object_a = scenario_.objectNamed(a);
  const ObjectId object_b = scenario_.objectNamed(b);
  return object_a.valid() && object_b.valid() ? scenario_.pairOf(object_a, object_b) : -1;
}

/// Whether the client controls every force-coupled hand of the trainee.
bool SessionRegistry::controlsBothHands(ClientId client) const {
  for (std::uint32_t i = 0; i < controllers_.size(); ++i) {
    const game_control::ScenarioHand& hand = scenario_.hands[i];
    const bool swappable = hand.role == Role::kTrainee && hand.kind == simulation::HandKind::kCoupled;
    if (swappable && !isController(client, HandId{i})) return false;
  }
  return true;
}

namespace {

Change gameChange(const Command& command, std::uint32_t signal = 0) {
  Change change{.kind = ChangeKind::kGameCommand};
  change.game = {command.kind, command.hand, signal, command.value};
  return change;
}

}  // namespace

Result<Change> SessionRegistry::changeFromCommand(const Command& command, Role role) const {
  const auto not_permitted = [&] {
    return fail(fmt::format("not permitted for the {}: ask the instructor", roleName(role)));
  };
  if (role == Role::kObserver || role == Role::kRecorder) return not_permitted();
  if (!std::isfinite(command.value)) return fail("its value is not a finite number");
  switch (command.kind) {
    case CommandKind::kFulfilled:
      return gameChange(command);
    case CommandKind::kSignal: {
      const int signal = scenario_.signalNamed(command.text);
      if (signal < 0) return fail(fmt::format("this scenario has no signal '{}'", command.text));
      return gameChange(command, static_cast<std::uint32_t>(signal));
    }
    case CommandKind::kRelease:
      return releaseChange(command, role);
    case CommandKind::kSwapHands:
      if (!hasInstructorRights(role) && !controlsBothHands(command.client))
        return fail("you do not control both hands");
      return gameChange(command);
    default:
      if (!hasInstructorRights(role)) return not_permitted();
      return instructorChange(command);
  }
}

Result<Change> SessionRegistry::releaseChange(const Command& command, Role role) const {
  const HandId hand = command.hand.valid() ? command.hand : scenario_.handNamed(command.text);
  if (!hasInstructorRights(role) && !isController(command.client, hand))
    return fail("you do not control that hand");
  if (hand.value >= controllers_.size())
    return fail(command.text.empty() ? "there is no such hand"
                                     : fmt::format("this scenario has no hand '{}'", command.text));
  return Change{.kind = ChangeKind::kRelease, .hand = hand};
}

Result<Change> SessionRegistry::instructorChange(const Command& command) const {
  switch (command.kind) {
    case CommandKind::kPause:
      return Change{.kind = ChangeKind::kPause};
    case CommandKind::kResume:
      return Change{.kind = ChangeKind::kResume};
    case CommandKind::kStop:
      return Change{.kind = ChangeKind::kStop};
    case CommandKind::kClearEmergencyStop:
      if (!emergency_stop_) return fail("there is no emergency stop");
      return Change{.kind = ChangeKind::kSetEmergencyStop, .value = 0.0};
    case CommandKind::kReset:
    case CommandKind::kSkipStep:
      return gameChange(command);
    case CommandKind::kSetCollision: {
      const std::size_t space = command.text.find(' ');
      const int pair = space == std::string::npos
                           ? -1
                           : findPair(command.text.substr(0, space), command.text.substr(space + 1));
      if (pair < 0)
        return fail(fmt::format("'{}' does not name the two objects of a collision pair", command.text));
      return Change{
          .kind = ChangeKind::kEnablePair, .index = static_cast<std::uint32_t>(pair), .value = command.value};
    }
    default:
      return fail("unknown command");
  }
}

void SessionRegistry::takeChanges(FixedVector<Change, kMaxChanges>& out) {
  std::size_t taken = 0;
  while (taken < changes_.size() && out.push_back(changes_[taken])) ++taken;
  changes_.erase(changes_.begin(), changes_.begin() + static_cast<std::ptrdiff_t>(taken));
}

}  // namespace tenon::session
