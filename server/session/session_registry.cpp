#include "server/session/session_registry.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include <fmt/format.h>

#include "idl/types/names.h"
#include "idl/types/printable_text.h"
#include "server/session/input_checks.h"

namespace tenon::session {
namespace {

constexpr std::size_t kMostReason = 255;  // [bytes] of CommandAck in idl/tenon.idl

bool mayControlHandOf(Role role, Role hand_role) {
  return has(role, Right::kMoveAnyHand) || (role == hand_role && has(role, Right::kMoveHands));
}

}  // namespace

SessionRegistry::SessionRegistry(const game_control::ScenarioFile& scenario, std::uint32_t server_epoch,
                                 bool lockstep)
    : scenario_(scenario),
      translator_(scenario),
      server_epoch_(server_epoch),
      lockstep_(lockstep),
      controllers_(scenario.hands.size()),
      limits_(scenario.hands.size()),
      round_trips_(scenario.hands.size()),
      mentoring_(scenario, server_epoch) {}

void SessionRegistry::resume(const std::vector<KeptSeat>& seats) {
  changes_.push_back({.kind = ChangeKind::kContinue});
  for (const KeptSeat& kept : seats) {
    clients_.push_back({kept.client, kept.name, kept.role, {}, false});
    Seat& seat = seats_.emplace_back();
    seat.key = kept.key;
    seat.is_closed = kept.is_closed;
  }
}

std::vector<KeptSeat> SessionRegistry::seatsToKeep() const {
  std::vector<KeptSeat> kept;
  for (std::size_t i = 0; i < seats_.size(); ++i)
    kept.push_back(
        {clients_[i].client, clients_[i].role, seats_[i].key, clients_[i].name, seats_[i].is_closed});
  return kept;
}

const Presence* SessionRegistry::findClient(ClientId client) const {
  const bool known = client.value >= 1 && client.value <= clients_.size();
  return known ? &clients_[client.value - 1] : nullptr;
}

std::size_t SessionRegistry::present(Role role) const {
  return static_cast<std::size_t>(
      std::count_if(clients_.begin(), clients_.end(),
                    [&](const Presence& person) { return person.alive && person.role == role; }));
}

std::optional<std::size_t> SessionRegistry::indexOf(const std::string& seat_key) const {
  for (std::size_t i = 0; i < seats_.size() && !seat_key.empty(); ++i)
    if (seats_[i].key == seat_key) return i;
  return std::nullopt;
}

bool SessionRegistry::isSeated(const std::string& client_guid) const {
  for (std::size_t i = 0; i < seats_.size(); ++i)
    if (clients_[i].alive && !client_guid.empty() && seats_[i].guid == client_guid) return true;
  return false;
}

bool SessionRegistry::mustProve(const Join& join) const {
  const RoleRights* const role = rightsOf(join.role);
  return (role != nullptr && (role->needs_key || key_of_all_)) || knowsSeat(join.seat_key);
}

bool SessionRegistry::anyHandControlled() const {
  return std::any_of(controllers_.begin(), controllers_.end(),
                     [](ClientId controller) { return controller.valid(); });
}

std::string SessionRegistry::joinRefusal(const Join& join, const JoinProofs& proofs) const {
  if (join.protocol_version != kProtocolVersion)
    return fmt::format("the server has protocol version {}, the client {}: update the older one",
                       kProtocolVersion, join.protocol_version);
  const RoleRights* const role = rightsOf(join.role);
  if (role == nullptr) return "unknown role";
  if (join.client_guid.empty())
    return "the join request has no client_guid: the answer could not be addressed";
  if (const auto former = indexOf(join.seat_key); former && seats_[*former].is_closed)
    return "you were removed from this session; ask the instructor to admit you to a new one";
  if (isSeated(join.client_guid)) return "another program has joined with this client_guid";
  if ((role->needs_key || key_of_all_) && !proofs.key)
    return join.key_proof.empty()
               ? fmt::format(
                     "the {} needs the key of this session: whoever started the server can hand you a "
                     "copy of its key file, to be named with --key",
                     roleName(join.role))
               : fmt::format(
                     "the key is not the one of this session, which the {} needs: ask whoever started "
                     "the server for a copy of its key file, and name it with --key",
                     roleName(join.role));
  const auto former = indexOf(join.seat_key);
  if (former && !proofs.seat)
    return "the seat is another program's: the proof that it is yours is missing or wrong";
  const bool keeps_seat = former && clients_[*former].alive && clients_[*former].role == join.role;
  if (!keeps_seat && present(join.role) >= role->seats)
    return fmt::format("all {} seats of the role {} are taken", role->seats, roleName(join.role));
  if (const std::string implausible = stiffnessRefusal(join.stiffness); !implausible.empty())
    return implausible;
  return handRefusal(join, former);
}

/// A hand of the `former` client of the seat is free: the request is of the same client.
std::string SessionRegistry::handRefusal(const Join& join, std::optional<std::size_t> former) const {
  for (const std::string& name : join.hands) {
    const HandId hand = scenario_.handNamed(name);
    if (!hand.valid()) continue;  // a station may offer more hands than the scenario has
    const Role owner = scenario_.hands[hand.value].role;
    if (!mayControlHandOf(join.role, owner))
      return fmt::format("hand '{}' belongs to the {}, not to the {}", name, roleName(owner),
                         roleName(join.role));
    const ClientId controller = controllers_[hand.value];
    if (controller.valid() && !(former && controller.value == *former + 1))
      return fmt::format("hand '{}' is already moved by somebody else", name);
  }
  return {};
}

bool SessionRegistry::ownsSeat(ClientId client, const wire::Origin& origin) const {
  return findClient(client) != nullptr && seats_[client.value - 1].origin == origin;
}

Welcome SessionRegistry::join(const Join& join, const JoinProofs& proofs, Tick now,
                              const wire::Origin& from) {
  Welcome welcome;
  welcome.client_guid = join.client_guid;
  welcome.session = join.session;
  welcome.server_epoch = server_epoch_;
  welcome.lockstep = lockstep_;
  welcome.tick = now;

  // a repeated request, because its answer was lost, gets the same answer
  for (std::size_t i = 0; i < seats_.size(); ++i) {
    Seat& seat = seats_[i];
    if (seat.guid.empty() || seat.guid != join.client_guid || seat.origin != from || !clients_[i].alive)
      continue;
    seat.welcome.tick = now;
    return seat.welcome;
  }
  welcome.reason = joinRefusal(join, proofs);
  if (!welcome.reason.empty()) return welcome;
  // a seat that is still taken: its former program ended unnoticed
  if (const auto former = indexOf(join.seat_key); former && clients_[*former].alive)
    leave(clients_[*former].client);
  assignSeat(join, welcome, from);
  return welcome;
}

std::size_t SessionRegistry::newSeat() {
  if (seats_.size() < kMaxSeats) {
    clients_.emplace_back();
    seats_.emplace_back();
    return seats_.size() - 1;
  }
  // the seats of all roles are fewer, so somebody has left
  std::size_t first = seats_.size();
  for (std::size_t i = 0; i < seats_.size(); ++i)
    if (!clients_[i].alive && (first == seats_.size() || seats_[i].left < seats_[first].left)) first = i;
  assert(first < seats_.size());
  seats_[first] = {};
  return first;
}

/// Of the coupling of the hand `join.hands[index]`, which the scenario has: as stiff as device and link
/// allow, and no stiffer than the scenario says. 0: not stated.
HandStiffness SessionRegistry::stiffnessOf(const Join& join, std::size_t index) const {
  const HandStiffness offered = index < join.stiffness.size() ? join.stiffness[index] : HandStiffness{};
  const game_control::ScenarioHand& hand = scenario_.hands[scenario_.handNamed(join.hands[index]).value];
  const auto least = [](double one, double other) {
    return one > 0.0 && other > 0.0 ? std::min(one, other) : std::max(one, other);
  };
  return {least(offered.translational, hand.stiffness), least(offered.rotational, hand.rotational_stiffness)};
}

void SessionRegistry::assignSeat(const Join& join, Welcome& welcome, const wire::Origin& from) {
  const auto former = indexOf(join.seat_key);
  const std::size_t index = former ? *former : newSeat();
  welcome.accepted = true;
  welcome.permitted_commands = permittedCommands(join.role);
  welcome.client = ClientId{static_cast<std::uint32_t>(index + 1)};
  std::vector<HandId> controlled;
  for (std::size_t i = 0; i < join.hands.size(); ++i) {
    const HandId hand = scenario_.handNamed(join.hands[i]);
    welcome.hands.push_back(hand);
    welcome.objects.push_back(hand.valid() ? scenario_.hands[hand.value].object : ObjectId{});
    if (!hand.valid()) continue;
    controllers_[hand.value] = welcome.client;
    limits_[hand.value] = {};
    round_trips_[hand.value] = former ? seats_[index].round_trip : 0.0;
    controlled.push_back(hand);
    changes_.push_back({.kind = ChangeKind::kAttach, .hand = hand, .stiffness = stiffnessOf(join, i)});
    if (round_trips_[hand.value] > 0.0) pushLimits(hand);  // until the link has been measured again
  }
  clients_[index] = {welcome.client, join.name, join.role, controlled, true};
  welcome.people = static_cast<std::uint32_t>(
      std::count_if(clients_.begin(), clients_.end(), [](const Presence& person) { return person.alive; }));
  seats_[index].guid = join.client_guid;
  seats_[index].key = join.seat_key;
  seats_[index].welcome = welcome;
  seats_[index].origin = from;
  seats_[index].last_ack = {};
}

std::optional<std::string> SessionRegistry::holderOf(const std::string& seat_key) const {
  const auto index = indexOf(seat_key);
  if (!index || !clients_[*index].alive) return std::nullopt;
  return seats_[*index].guid;
}

void SessionRegistry::leave(ClientId client) {
  if (findClient(client) == nullptr) return;
  Presence& who = clients_[client.value - 1];
  if (who.alive) seats_[client.value - 1].left = ++departures_;
  who.alive = false;
  mentoring_.left(client);
  for (std::uint32_t i = 0; i < controllers_.size(); ++i) {
    if (controllers_[i] != client) continue;
    controllers_[i] = {};
    limits_[i] = {};
    round_trips_[i] = 0.0;
    changes_.push_back({.kind = ChangeKind::kDetach, .hand = HandId{i}});
  }
}

void SessionRegistry::engageEmergencyStop() {
  if (gate_.isStopEngaged()) return;
  gate_.engageStop();
  // before what waits, but for the end of an earlier stop
  const auto earlier = std::find_if(changes_.rbegin(), changes_.rend(), [](const Change& change) {
    return change.kind == ChangeKind::kSetEmergencyStop;
  });
  changes_.insert(earlier.base(), Change{.kind = ChangeKind::kSetEmergencyStop, .value = 1.0});
}

void SessionRegistry::clearEmergencyStop() {
  // `resume` continues
  gate_.clearStop();
  changes_.push_back({.kind = ChangeKind::kPause});
  changes_.push_back({.kind = ChangeKind::kSetEmergencyStop, .value = 0.0});
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
  return checkedReading(input, name);
}

bool SessionRegistry::setLimits(ClientId client, const HandLimits& limits, double round_trip,
                                const KeptBack& kept_back) {
  const HandLimits bounded{std::clamp(limits.freeze_ticks, kFreezeTicks, kMostFreezeTicks),
                           std::clamp(limits.park_ticks, kParkTicks, kMostParkTicks)};
  constexpr double kMostTrip = 1.0;  // [s]
  bool changed = false;
  double longest = 0.0;  // [s]
  for (std::uint32_t i = 0; i < controllers_.size(); ++i) {
    if (!isController(client, HandId{i})) continue;
    const bool is_coupled = scenario_.hands[i].kind == simulation::HandKind::kCoupled;
    const double kept = is_coupled && kept_back ? kTickSeconds * kept_back(HandId{i}) : 0.0;
    const double trip = std::min(kMostTrip, kept + (round_trip > 0.0 ? round_trip : 0.0));
    // a longer one counts at once, a shorter one when it is two steps shorter
    const bool is_same_trip =
        trip <= std::max(round_trips_[i], kTripStep) && trip > round_trips_[i] - 2.0 * kTripStep;
    if (!is_same_trip) round_trips_[i] = trip <= kTripStep ? 0.0 : kTripStep * std::ceil(trip / kTripStep);
    longest = std::max(longest, round_trips_[i]);
    if (limits_[i] == bounded && is_same_trip) continue;
    limits_[i] = bounded;
    changed = true;
    pushLimits(HandId{i});
  }
  if (changed) seats_[client.value - 1].round_trip = longest;
  return changed;
}

void SessionRegistry::pushLimits(HandId hand) {
  changes_.push_back({.kind = ChangeKind::kSetLimits,
                      .hand = hand,
                      .index = limits_[hand.value].freeze_ticks,
                      .lifetime_ticks = limits_[hand.value].park_ticks,
                      .value = round_trips_[hand.value]});
}

Result<Change> SessionRegistry::validateForceContribution(const ForceContribution& force) const {
  const Presence* who = findClient(force.client);
  if (who == nullptr || !who->alive || !has(who->role, Right::kContributeForces))
    return fail(fmt::format("client {} may not contribute forces", force.client.value));
  return checkedForce(force, scenario_);
}

Result<Change> SessionRegistry::validateExternalPose(const ExternalPose& pose) const {
  const Presence* who = findClient(pose.client);
  if (who == nullptr || !who->alive || !has(who->role, Right::kPlaceObjects))
    return fail(fmt::format("client {} may not place objects", pose.client.value));
  return checkedPose(pose, scenario_);
}

CommandAck SessionRegistry::handleCommand(const Command& command, const NewestRaise& newest) {
  const Presence* who = findClient(command.client);
  if (who == nullptr || !who->alive)
    return {command.client, command.id, false, "join first", Refusal::kNotJoined};
  CommandAck ack = decide(command, who->role, newest);
  seats_[command.client.value - 1].last_ack = ack;
  return ack;
}

const CommandAck* SessionRegistry::previousAck(const Command& command) const {
  const Presence* who = findClient(command.client);
  if (who == nullptr || !who->alive) return nullptr;
  const CommandAck& ack = seats_[command.client.value - 1].last_ack;
  return ack.id == command.id && command.id != 0 ? &ack : nullptr;
}

CommandAck SessionRegistry::decide(const Command& command, Role role, const NewestRaise& newest) {
  const auto answer = [&](const tl::expected<void, Refused>& done) {
    return done ? CommandAck{command.client, command.id, true, {}, Refusal::kNone}
                : CommandAck{command.client, command.id, false, shortened(done.error().what, kMostReason),
                             done.error().why};
  };
  if (!has(role, rightFor(command.kind))) return answer(notPermitted(role));
  if (command.kind == CommandKind::kNote) return answer(checkNote(command));
  if (command.kind == CommandKind::kKick) return answer(kick(command, role));
  if (command.kind == CommandKind::kGuide) {
    if (const auto possible = gate_.check(command.kind); !possible) return answer(possible);
    return answer(mentoring_.decide(command.text, command.client, role, controllers_));
  }
  const auto change =
      translator_.changeFor(command, {.role = role,
                                      .controllers = controllers_,
                                      .is_stop_engaged = isStopEngaged(),
                                      .newest = newest,
                                      .is_instructor_present = isRolePresent(Role::kInstructor),
                                      .step = accepted_.waiting() > 0 ? std::nullopt : step_});
  if (!change) return answer(tl::unexpected(change.error()));
  if (const auto possible = gate_.check(command.kind); !possible) return answer(possible);
  const bool is_vital = command.kind == CommandKind::kStop || command.kind == CommandKind::kPause ||
                        command.kind == CommandKind::kResume ||
                        command.kind == CommandKind::kClearEmergencyStop;
  // what is accepted has its place in the simulation
  const bool is_of_steps = change->kind == ChangeKind::kGameCommand;
  if (!is_vital && (changes_.size() >= kMostWaitingChanges ||
                    (is_of_steps && accepted_.waiting() >= kMostWaitingCommands)))
    return answer(refuse(Refusal::kTooMany, "too many commands wait already: send it again in a moment"));
  gate_.accept(change->kind);
  if (is_of_steps) accepted_.add(commandText(command, findClient(command.client)->name));
  if (change->kind == ChangeKind::kSetEmergencyStop) {
    clearEmergencyStop();
    return answer({});
  }
  changes_.push_back(*change);
  return answer({});
}

tl::expected<void, Refused> SessionRegistry::checkNote(const Command& command) {
  if (command.text.empty()) return refuse(Refusal::kOther, "the note is empty");
  return {};
}

/// Removes a person and closes the seat, which cannot be taken again with its key.
tl::expected<void, Refused> SessionRegistry::kick(const Command& command, Role role) {
  const auto person = findPerson(command.text);
  if (!person) return tl::unexpected(person.error());
  const Presence& who = *findClient(*person);
  if (*person == command.client) return refuse(Refusal::kOther, "that is yourself: leave instead");
  if (who.role == Role::kAdmin && role != Role::kAdmin)
    return refuse(Refusal::kNotPermitted,
                  fmt::format("{} is an admin, whom an admin alone removes", who.name));
  Seat& seat = seats_[person->value - 1];
  // of a server that was killed before it had answered the command, that is repeated then
  const bool is_of_former_server = seat.guid.empty();
  if (seat.is_closed && !is_of_former_server)
    return refuse(Refusal::kAlready, fmt::format("{} has been removed already", who.name));
  seat.is_closed = true;
  kicked_.push_back(*person);
  return {};
}

/// By number or by name: of those who are there, else of those who have gone.
tl::expected<ClientId, Refused> SessionRegistry::findPerson(const std::string& text) const {
  for (const bool is_there : {true, false}) {
    ClientId found;
    for (const Presence& person : clients_) {
      if (person.alive != is_there) continue;
      if (std::to_string(person.client.value) == text) return person.client;
      if (person.name != text) continue;
      if (found.valid())
        return refuse(Refusal::kUnknownName,
                      fmt::format("several people are named {}: give the number, {} or {}", inQuotes(text),
                                  found.value, person.client.value));
      found = person.client;
    }
    if (found.valid()) return found;
  }
  std::vector<std::string> people;
  for (const Presence& person : clients_)
    if (person.alive) people.push_back(person.name);
  return refuse(Refusal::kUnknownName,
                fmt::format("nobody is named {} in this session{}", inQuotes(text), namesInstead(people)));
}

std::vector<ClientId> SessionRegistry::takeKicked() { return std::exchange(kicked_, {}); }

void SessionRegistry::takeChanges(FixedVector<Change, kMaxChanges>& out) {
  std::size_t taken = 0;
  while (taken < changes_.size() && out.push_back(changes_[taken])) ++taken;
  changes_.erase(changes_.begin(), changes_.begin() + static_cast<std::ptrdiff_t>(taken));
}

}  // namespace tenon::session
