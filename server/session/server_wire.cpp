#include "server/session/server_wire.h"

#include <algorithm>
#include <optional>
#include <thread>
#include <tuple>
#include <utility>

#include <fmt/format.h>
#include <unistd.h>

#include "idl/types/messages/journal.h"
#include "idl/types/names.h"
#include "idl/types/printable_text.h"
#include "server/session/scene_loader.h"
#include "server/session/server_writers.h"
#include "server/session/session_lock.h"
#include "server/session/stop_file.h"

namespace tenon::session {
namespace {

constexpr auto kOtherServers = std::chrono::milliseconds(500);  // for their announcements to arrive
// without a sign of life for so long the announcement of a server ends (its lease)
constexpr auto kLapse = wire::kSessionAnnounce.parameters.lease;
// A reader that took this server for dead knows its announcement again, and so its next end, by another
// sample alone.
constexpr auto kAnnounceInterval = std::chrono::seconds(1);
// joins and leaves of clients without hands: one after each
constexpr auto kBetweenSeats = std::chrono::milliseconds(5);
constexpr std::size_t kMostWaiting = 512;
constexpr auto kBetweenLimits = std::chrono::milliseconds(500);  // changes of a station's limits
constexpr auto kAfterLapse = std::chrono::seconds(10);  // until those who came meanwhile are discovered

std::int64_t nowNanoseconds() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

}  // namespace

ServerWire::ServerWire(const WireOptions& options, std::shared_ptr<wire::Participant> participant,
                       SessionRegistry& registry, InputBuffer& input_buffer, Publisher& publisher)
    : options_(options),
      participant_(std::move(participant)),
      lobby_(participant_, wire::kLobby, wire::LinkProfile::kLan),
      session_(participant_, wire::sessionPartition(options.session)),
      writers_(std::make_unique<ServerWriters>()),
      registry_(registry),
      input_buffer_(input_buffer),
      publisher_(publisher) {
  if (options_.publish_journal) copies_ = std::make_unique<JournalCopies>(participant_, options_.session);
  if (!options_.seat_file.empty()) seats_ = std::make_unique<SeatKeeper>(options_.seat_file);
}

Result<std::unique_ptr<ServerWire>> ServerWire::open(const WireOptions& options, const LoadedScene& loaded,
                                                     SessionRegistry& registry, InputBuffer& input_buffer,
                                                     Publisher& publisher) {
  auto participant = wire::Participant::open(
      {.domain = options.domain,
       .profile = options.lockstep ? wire::LinkProfile::kLockstep : wire::LinkProfile::kLan,
       .config = {}});
  if (!participant) return fail(participant.error().what);
  std::unique_ptr<ServerWire> wire(
      new ServerWire(options, std::move(*participant), registry, input_buffer, publisher));
  wire->title_ = loaded.scenario->title.front().text;
  wire->scenario_hash_ = fmt::format("{:016x}", loaded.scenario->text_hash);
  wire->scenario_ = scenarioName(loaded.scenario->path);
  wire->newest_seq_.resize(loaded.scenario->hands.size());
  if (auto alone = wire->refuseBesideAnother(); !alone) return fail(alone.error().what);
  if (auto opened = wire->writers_->open(wire->lobby_, wire->session_, wire->writes_); !opened)
    return fail(opened.error().what);
  if (auto opened = wire->openReaders(); !opened) return fail(opened.error().what);
  wire->sendScene(loaded);
  if (auto restored = wire->restoreStops(); !restored) return fail(restored.error().what);
  wire->announce();
  return wire;
}

/// On this machine the SessionLock decides; this is for servers on other machines.
Result<void> ServerWire::refuseBesideAnother() {
  auto reader = wire::Reader<SessionAnnounce>::open(lobby_, wire::kSessionAnnounce);
  if (!reader) return fail(reader.error().what);
  const auto until = std::chrono::steady_clock::now() + kOtherServers;
  SessionAnnounce other;
  while (std::chrono::steady_clock::now() < until) {
    while (reader->take(other))
      if (other.session == options_.session)
        return fail(servedAlready(other.session, std::to_string(other.pid), other.host));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return {};
}

/// A server that is newer than this one is of no concern while this one lives: clients ignore it. Once this
/// one was stopped for so long that clients took it for dead, the newer one has them.
void ServerWire::handle(const SessionAnnounce& other, const wire::Origin& from) {
  if (other.session != options_.session || !from.known() || from == participant_->origin()) return;
  if (!others_.emplace(other.server_epoch, other).second) return;
  log(Severity::kWarning, "another server",
      fmt::format(
          "another server of session '{}' runs as process {} on host {}: clients of this one ignore it",
          other.session, other.pid, other.host));
}

void ServerWire::noticeLapse() {
  const auto now = std::chrono::steady_clock::now();
  if (now - announced_at_ > kAnnounceInterval) announce();
  if (dispatched_ && now - *dispatched_ > kLapse) lapsed_ = now;
  dispatched_ = now;
  if (!lapsed_) return;
  for (const auto& [epoch, other] : others_)
    if (epoch > options_.server_epoch)
      replaced_ = fmt::format(
          "this server was stopped for a while, and process {} on host {} serves session '{}' now: this one "
          "ends",
          other.pid, other.host, other.session);
  if (now - *lapsed_ > kAfterLapse) lapsed_.reset();
}

Result<void> ServerWire::restoreStops() {
  auto kept = readStopFile(options_.stop_file);
  if (!kept) return fail(kept.error().what);
  stops_ = std::move(*kept);
  for (const auto& [id, stop] : stops_.standing()) writers_->stop.send(stop);
  for (const auto& [id, cleared] : stops_.cleared()) writers_->clear.send(cleared);
  if (stops_.engaged()) registry_.engageEmergencyStop();
  return {};
}

void ServerWire::keepStops() {
  if (auto kept = writeStopFile(options_.stop_file, stops_); !kept)
    log(Severity::kError, "emergency stop",
        fmt::format("the emergency stop would not outlive a crash of the server: {}", kept.error().what));
}

Result<void> ServerWire::openReaders() {
  Result<void> result;
  const auto listenTo = [&]<class M>(wire::Partition& partition, const wire::Topic<M>& topic, auto handler) {
    if (result) result = inbox_.onFrom<M>(partition, topic, handler);
  };
  listenTo(lobby_, wire::kJoin, [this](const Join& join, const wire::Origin& from) { receive(join, from); });
  listenTo(session_, wire::kDeviceInput,
           [this](const DeviceInput& input, const wire::Origin& from) { handle(input, from); });
  listenTo(session_, wire::kCommand,
           [this](const Command& command, const wire::Origin& from) { handle(command, from); });
  listenTo(session_, wire::kClockSync, [this](const ClockSync& sync, const wire::Origin& from) {
    if (registry_.ownsSeat(sync.client, from)) handle(sync);
  });
  listenTo(session_, wire::kTelemetry, [this](const Telemetry& telemetry, const wire::Origin& from) {
    if (isGenuine(telemetry.client, from, "telemetry")) handle(telemetry);
  });
  listenTo(lobby_, wire::kSessionAnnounce,
           [this](const SessionAnnounce& other, const wire::Origin& from) { handle(other, from); });
  listenTo(session_, wire::kEmergencyStop,
           [this](const EmergencyStop& stop, const wire::Origin& from) { handle(stop, from); });
  const auto take = [this](ClientId client, const Result<Change>& change) {
    if (!change) return refuse(change.error().what);
    if (!contributions_.put(client, *change))
      refuse(fmt::format("client {} sends more than {} forces and poses at a time: the others are ignored",
                         client.value, Contributions::kMostOfClient));
  };
  listenTo(session_, wire::kForceContribution,
           [this, take](const ForceContribution& force, const wire::Origin& from) {
             if (isGenuine(force.client, from, "force"))
               take(force.client, registry_.validateForceContribution(force));
           });
  listenTo(session_, wire::kExternalPose, [this, take](const ExternalPose& pose, const wire::Origin& from) {
    if (isGenuine(pose.client, from, "pose")) take(pose.client, registry_.validateExternalPose(pose));
  });
  if (result) {
    result = inbox_.onGoneFrom<Presence>(
        session_, wire::kPresence,
        [this](const Presence& gone, const wire::Origin& from) { handleGone(gone, from); });
  }
  if (result) {
    result =
        inbox_.onGone<SessionAnnounce>(lobby_, wire::kSessionAnnounce, [this](const SessionAnnounce& gone) {
          if (gone.session == options_.session) others_.erase(gone.server_epoch);
        });
  }
  return result;
}

void ServerWire::sendScene(const LoadedScene& loaded) {
  for (std::uint32_t i = 0; i < loaded.scene->objects.size(); ++i) {
    writers_->object.send(describe(ObjectId{i}, loaded.scene->objects[i]));
  }
  const game_control::ScenarioFile& scenario = *loaded.scenario;
  for (std::uint32_t i = 0; i < scenario.hands.size(); ++i) {
    const game_control::ScenarioHand& hand = scenario.hands[i];
    scene_hands_.push_back({HandId{i}, hand.name, hand.role, hand.object, {}});
    writers_->hand.send(scene_hands_.back());
  }
  const auto steps = static_cast<std::uint32_t>(scenario.states.size());
  scene_ = {.objects = static_cast<std::uint32_t>(loaded.scene->objects.size()),
            .hands = static_cast<std::uint32_t>(scenario.hands.size()),
            .steps = steps};
  for (std::uint32_t i = 0; i < steps; ++i) {
    const game_control::ScenarioState& state = scenario.states[i];
    writers_->scene_step.send({i, steps, state.name, state.title, state.part});
  }
}

void ServerWire::announce() {
  announced_at_ = std::chrono::steady_clock::now();
  writers_->announce.send({.session = options_.session,
                           .server_epoch = options_.server_epoch,
                           .title = title_,
                           .lockstep = options_.lockstep,
                           .objects = scene_.objects,
                           .hands = scene_.hands,
                           .steps = scene_.steps,
                           .resumed_after = options_.resumed_after,
                           .scenario_hash = scenario_hash_,
                           .host = hostName(),
                           .pid = static_cast<std::uint32_t>(getpid()),
                           .scene_hash = options_.scene_hash,
                           .scenario = scenario_,
                           .detail = options_.detail,
                           .freeze_ticks = static_cast<std::uint32_t>(options_.limits.freeze),
                           .park_ticks = static_cast<std::uint32_t>(options_.limits.park)});
}

void ServerWire::dispatch(std::chrono::nanoseconds timeout) {
  const bool waits = !joins_.empty() || !leaves_.empty() || !kicks_.empty();
  inbox_.dispatch(waits ? std::min<std::chrono::nanoseconds>(timeout, kBetweenSeats) : timeout);
  handleJoinsAndLeaves();
  finishKicks();
  dismissStuckRecorders();
  if (const auto error = seats_ ? seats_->takeError() : std::nullopt) log(Severity::kError, "seats", *error);
  noticeLapse();
  forwardChanges();
}

void ServerWire::forwardChanges() {
  // while the queue is nearly full they stay in the registry, until the tick has caught up
  if (input_buffer_.freeChanges() < kMaxChanges) return;
  FixedVector<Change, kMaxChanges> changes;
  registry_.takeChanges(changes);
  for (const Change& change : changes) input_buffer_.put(change);
  publishLimits();
  contributions_.forward(input_buffer_);
}

void ServerWire::update(const TickOutput& output) {
  now_ = output.tick;
  registry_.updatePhase(output.phase, output.emergency_stop);
  sendGuidance(output);
}

/// Of each tick, so that a server that is behind sends what is due, and stations take the newest.
void ServerWire::sendGuidance(const TickOutput& output) {
  std::vector<std::string> ended;
  for (const Guidance& fixture : registry_.guidance(output, ended)) writers_->guidance.send(fixture);
  for (const std::string& why : ended) log(Severity::kInfo, "guidance", why);
}

void ServerWire::log(Severity severity, const std::string& kind, const std::string& text) {
  const std::string clean = printable(text);
  send(publisher_.eventGenerator().makeEvent(severity, kind, clean));
  if (print) print(clean);
}

void ServerWire::refuse(const std::string& why) {
  ++refused_inputs_;
  constexpr std::size_t kMaxLogged = 100;
  if (logged_refusals_.size() < kMaxLogged && logged_refusals_.insert(why).second)
    log(Severity::kWarning, "refused", why);
}

/// Whether a sample that names `client` was written by the participant with its seat; if not, refuses it.
bool ServerWire::isGenuine(ClientId client, const wire::Origin& from, const std::string& what) {
  // unknown clients are refused by the registry
  if (registry_.findClient(client) == nullptr || registry_.ownsSeat(client, from)) return true;
  // an unknown origin: the writer of the sample ended in the meantime
  if (from.known())
    refuse(
        fmt::format("a {} under the id of client {} came from another program than the one that joined: "
                    "ignored",
                    what, client.value));
  return false;
}

/// To a program that still sends although its seat is lost, so that it can rejoin; at most once a second.
void ServerWire::notifySeatLost(ClientId client, const std::string& why) {
  constexpr auto kInterval = std::chrono::seconds(1);
  const auto now = std::chrono::steady_clock::now();
  const auto last = seat_lost_notified_.find(client);
  if (last != seat_lost_notified_.end() && now - last->second < kInterval) return;
  seat_lost_notified_[client] = now;
  writers_->welcome.send({.client_guid = registry_.guidOf(client),
                          .session = options_.session,
                          .server_epoch = options_.server_epoch,
                          .accepted = false,
                          .reason = why,
                          .client = client,
                          .tick = now_});
}

/// Queues a request; the program repeats one that finds no room.
void ServerWire::receive(const Join& join, const wire::Origin& from) {
  if (join.session != options_.session || join.server_epoch != options_.server_epoch) return;
  const auto same = [&](const auto& waiting) { return waiting.first.client_guid == join.client_guid; };
  if (const auto found = std::find_if(joins_.begin(), joins_.end(), same); found != joins_.end()) {
    *found = {join, from};
  } else if (joins_.size() < kMostWaiting) {
    joins_.emplace_back(join, from);
  }
}

/// One after the other, so that a crowd that comes or goes does not delay frames.
void ServerWire::handleJoinsAndLeaves() {
  const auto now = std::chrono::steady_clock::now();
  if ((joins_.empty() && leaves_.empty()) || now < next_change_of_seats_) return;
  next_change_of_seats_ = now + kBetweenSeats;
  if (!leaves_.empty()) {
    dismiss(leaves_.front(), "has left");
    leaves_.pop_front();
  } else {
    const auto [join, from] = std::move(joins_.front());
    joins_.pop_front();
    handle(join, from);
  }
}

void ServerWire::dismissStuckRecorders() {
  if (!copies_) return;
  for (const ClientId client : copies_->takeStuck())
    dismiss(client, "takes no inputs of the ticks, and is removed until it joins again");
}

void ServerWire::handle(const Join& join, const wire::Origin& from) {
  const bool is_new = !registry_.isSeated(join.client_guid);
  const bool is_known = registry_.knowsSeat(join.seat_key);
  const wire::ProofSubject subject{.challenge = challenges_.challengeFor(from, join.client_guid),
                                   .session = options_.session,
                                   .server_epoch = options_.server_epoch,
                                   .client_guid = join.client_guid,
                                   .role = join.role,
                                   .client = from};
  if (is_new && registry_.mustProve(join) && join.seat_proof.empty()) {
    writers_->welcome.send({.client_guid = join.client_guid,
                            .session = options_.session,
                            .server_epoch = options_.server_epoch,
                            .reason = "prove who you are",
                            .challenge = subject.challenge});
    return;
  }
  const JoinProofs proofs{.seat = wire::SeatKey::isProof(join.seat_key, subject, join.seat_proof),
                          .key = options_.key && options_.key->isProof(subject, join.key_proof)};
  const Welcome welcome = registry_.join(join, proofs, now_, from);
  writers_->welcome.send(welcome);
  if (!is_new) return;
  for (const HandId hand : welcome.hands) {
    if (!hand.valid()) continue;
    newest_seq_[hand.value] = 0;
    input_buffer_.setPlayout(hand, 0);
  }
  received_inputs_.erase(welcome.client);
  if (welcome.accepted && seats_) seats_->keep(registry_.seatsToKeep());
  if (welcome.accepted && copies_ && join.role == Role::kRecorder)
    copies_->admit(welcome.client, from, join.recorded_until);
  const char* how = is_known ? "has rejoined" : "has joined";
  log(welcome.accepted ? Severity::kInfo : Severity::kWarning, "join",
      welcome.accepted ? fmt::format("{} ({}) {}", join.name, roleName(join.role), how)
                       : fmt::format("{} may not join: {}", join.name, welcome.reason));
}

void ServerWire::handle(const DeviceInput& input, const wire::Origin& from) {
  // of a station that is on its way back from an earlier life of the server
  if (input.server_epoch != options_.server_epoch && !registry_.ownsSeat(input.client, from)) return;
  if (!isGenuine(input.client, from, "device input")) return;
  const Presence* sender = registry_.findClient(input.client);
  if (sender != nullptr && !sender->alive && input.server_epoch == options_.server_epoch)
    return notifySeatLost(input.client, "its process or link was lost");
  const auto reading = registry_.validateDeviceInput(input);
  if (!reading) return refuse(reading.error().what);
  ReceivedInputs& received = received_inputs_[input.client];
  ++received.count;
  received.gaps.received(nowNanoseconds());
  received.newest_seq = std::max(received.newest_seq, reading->seq);
  std::uint32_t& newest = newest_seq_[input.hand.value];
  if (options_.lockstep && reading->seq == newest && newest == now_) resend_requested_ = true;
  if (reading->seq <= newest && newest - reading->seq < 0x80000000U) return;  // out of order, or a repetition
  if (options_.lockstep && reading->seq > now_ + 1)
    return dismiss(input.client,
                   fmt::format("sent the input of tick {} when tick {} was the next, and is removed: in "
                               "lockstep an input answers a received tick",
                               reading->seq, now_ + 1));
  if (input_buffer_.playout(input.hand) > 0) handleEarlier(input, newest);
  newest = reading->seq;
  input_buffer_.put(*reading);
}

/// Those after `newest`, whose own messages are lost or late.
void ServerWire::handleEarlier(const DeviceInput& input, std::uint32_t newest) {
  DeviceInput one = input;
  for (std::size_t i = input.earlier.size(); i-- > 0;) {
    one.sample = input.earlier[i];
    if (one.sample.seq <= newest || one.sample.seq >= input.sample.seq) continue;
    if (const auto reading = registry_.validateDeviceInput(one)) input_buffer_.put(*reading);
  }
}

void ServerWire::handle(const Command& command, const wire::Origin& from) {
  if (!isGenuine(command.client, from, "command")) return;
  if (const CommandAck* again = registry_.previousAck(command)) {
    const auto isAgain = [&](const Kick& kick) {
      return kick.command.client == command.client && kick.command.id == command.id;
    };
    if (std::none_of(kicks_.begin(), kicks_.end(), isAgain)) writers_->ack.send(*again);
    return;
  }
  const Presence* sender = registry_.findClient(command.client);
  const std::string who = sender != nullptr ? sender->name : fmt::format("client {}", command.client.value);
  const CommandAck ack = registry_.handleCommand(command);
  if (std::vector<ClientId> kicked = registry_.takeKicked(); !kicked.empty()) {
    const std::uint64_t kept = seats_ ? seats_->keep(registry_.seatsToKeep()) : 0;
    for (const ClientId client : kicked) dismiss(client, "was removed by " + who);
    kicks_.push_back({command, ack, who, kept});
    return finishKicks();
  }
  answer(command, ack, who);
}

/// Answers once the seat is closed in the file too: who was told that somebody is removed does not meet that
/// person again when the server is killed and resumed.
void ServerWire::finishKicks() {
  while (!kicks_.empty() && (!seats_ || seats_->isDone(kicks_.front().seats_kept))) {
    const Kick kick = std::move(kicks_.front());
    kicks_.pop_front();
    answer(kick.command, kick.ack, kick.who);
  }
}

void ServerWire::answer(const Command& command, const CommandAck& ack, const std::string& who) {
  writers_->ack.send(ack);
  if (!ack.accepted) {
    log(Severity::kWarning, "refused",
        fmt::format("{}: '{}': {}", who, commandName(command.kind), ack.reason));
  } else if (command.kind == CommandKind::kNote) {
    log(Severity::kInfo, "note", fmt::format("{}: {}", who, command.text));
  } else if (command.kind == CommandKind::kClearEmergencyStop) {
    clearEmergencyStop(command.client, command.text);
  } else {
    log(Severity::kInfo, "command",
        fmt::format("{}: {}{}{}", who, commandName(command.kind), command.text.empty() ? "" : " ",
                    command.text));
  }
}

/// Anybody may raise the stop. The server stops the simulation, publishes the raise itself, for late joiners
/// and in case its writer leaves, and keeps it on disk.
void ServerWire::handle(const EmergencyStop& stop, const wire::Origin& from) {
  if (from != participant_->origin() && stops_.raise(stop)) engage(stop);
}

void ServerWire::raiseStop(const std::string& reason) {
  const EmergencyStop stop{
      .client_guid = "server", .counter = options_.server_epoch, .who = "server", .reason = reason};
  if (!registry_.isStopEngaged() && stops_.raise(stop)) engage(stop);
}

void ServerWire::engage(const EmergencyStop& stop) {
  registry_.engageEmergencyStop();
  forwardChanges();
  writers_->stop.send(stop);
  keepStops();
  log(Severity::kError, "emergency stop", fmt::format("engaged by {}: {}", stop.who, stop.reason));
}

/// Clears all raises that stand, and those alone: one that is on its way will stand.
void ServerWire::clearEmergencyStop(ClientId client, const std::string& reason) {
  const std::string& who = registry_.findClient(client)->name;
  const auto standing = stops_.standing();
  for (const auto& [id, stop] : standing) stops_.clear({stop.client_guid, stop.counter, who, reason});
  keepStops();
  for (const auto& [id, stop] : standing) {
    writers_->clear.send(stops_.cleared().at(id));
    (void)writers_->stop.writer->dispose(stop);
  }
  const char* const next = registry_.phase() == RunPhase::kWaitingForPeople
                               ? "the session still waits for people"
                               : "the session is paused until 'resume'";
  log(Severity::kInfo, "emergency stop",
      fmt::format("cleared by {}: {}{}{}", who, reason, reason.empty() ? "" : "; ", next));
}

void ServerWire::handle(const ClockSync& sync) {
  if (sync.server_sent_ns != 0) return;  // the server's own answer
  ClockSync answer = sync;
  answer.server_received_ns = nowNanoseconds();
  if (const auto inputs = received_inputs_.find(sync.client); inputs != received_inputs_.end()) {
    answer.inputs_received = inputs->second.count;
    answer.newest_seq = inputs->second.newest_seq;
    answer.longest_gap = inputs->second.gaps.longest(nowNanoseconds());
    for (const HandId hand : registry_.findClient(sync.client)->hands) {
      answer.inputs_replaced += input_buffer_.replaced(hand);
      answer.ticks_without_input += input_buffer_.missed(hand);
    }
  }
  answer.server_sent_ns = nowNanoseconds();
  writers_->clock.send(answer);
}

/// What a station asks for by what its link does. In lockstep the server waits for inputs: no limit applies.
void ServerWire::handle(const Telemetry& telemetry) {
  registry_.receive(telemetry);
  const auto inputs = received_inputs_.find(telemetry.client);
  if (options_.lockstep || inputs == received_inputs_.end()) return;
  const Presence& station = *registry_.findClient(telemetry.client);
  for (const HandId hand : station.hands)
    if (registry_.controllerOf(hand) == telemetry.client)
      input_buffer_.setPlayout(hand, telemetry.playout_ticks);
  const auto now = std::chrono::steady_clock::now();
  if (now - inputs->second.limits_set_at < kBetweenLimits) return;
  const double round_trip = telemetry.clock_known ? telemetry.round_trip : 0.0;
  if (!registry_.setLimits(telemetry.client, telemetry.limits, round_trip)) return;
  inputs->second.limits_set_at = now;
  const HandLimits& limits = registry_.limitsOf(station.hands.front());
  log(Severity::kInfo, "link",
      fmt::format(
          "{}: by its link of the last 10 s, without input a hand is held still after {} ms and parked after "
          "{} ms; now inputs are up to {:.0f} ms apart and {:.2f} % of them are lost",
          station.name, limits.freeze_ticks, limits.park_ticks,
          1e3 * inputs->second.gaps.longest(nowNanoseconds()), 1e2 * telemetry.inputs_lost));
}

void ServerWire::publishLimits() {
  for (SceneHand& hand : scene_hands_) {
    if (hand.limits == registry_.limitsOf(hand.hand)) continue;
    hand.limits = registry_.limitsOf(hand.hand);
    writers_->hand.send(hand);
  }
}

void ServerWire::handleGone(const Presence& presence, const wire::Origin& from) {
  if (from.known() && !isGenuine(presence.client, from, "departure notice")) return;
  const Presence* leaver = registry_.findClient(presence.client);
  if (leaver == nullptr || !leaver->alive) return;
  // hands are freed at once
  if (!leaver->hands.empty() || leaves_.size() >= kMostWaiting) return dismiss(presence.client, "has left");
  leaves_.push_back(presence.client);
}

void ServerWire::dismiss(ClientId client, const std::string& why) {
  const Presence* leaver = registry_.findClient(client);
  if (leaver == nullptr || !leaver->alive) return;
  const std::string text = fmt::format("{} ({}) {}", leaver->name, roleName(leaver->role), why);
  registry_.leave(client);
  if (copies_ && leaver->role == Role::kRecorder) copies_->dismiss(client);
  notifySeatLost(client, why);
  log(Severity::kWarning, "leave", text);
  forwardChanges();
}

void ServerWire::send(const EventLog& event) { writers_->event.send(event); }

void ServerWire::send(const RunState& run) { writers_->run.send(run); }

void ServerWire::resendLast() {
  if (last_ == nullptr) return;
  for (const WorldFrame& frame : last_->frames) writers_->frame_1k.write(frame);
  for (const HandManifold* manifold : last_->manifolds) writers_->manifold.write(*manifold);
}

void ServerWire::send(const OutgoingMessages& outgoing) {
  last_ = &outgoing;
  const Tick period_begin = (now_ - 1) / kPublishedSamplesPeriod * kPublishedSamplesPeriod + 1;
  if (period_begin != published_.first_tick) statePublished();
  published_.first_tick = period_begin;
  ServerWriters& to = *writers_;
  // the step before the frames, which refer to its revision
  if (outgoing.events.step) to.step.send(*outgoing.events.step);
  for (const CollisionMatrix& matrix : outgoing.events.matrix) to.matrix.send(matrix);
  for (const GrabState& grab : outgoing.events.grabs) to.grab.write(grab);
  for (const ObjectSnapshot& snapshot : outgoing.events.snapshots) to.snapshot.write(snapshot);
  for (const WorldFrame& frame : outgoing.frames) to.frame_1k.write(frame);
  for (const HandManifold* manifold : outgoing.manifolds) to.manifold.write(*manifold);
  for (const WorldFrame& frame : outgoing.frames_100) to.frame_100.write(frame);
  for (const WorldFrame& frame : outgoing.frames_30) to.frame_30.write(frame);
  for (const ContactPairs& pairs : outgoing.pairs) to.pairs.write(pairs);
  if (outgoing.stats) to.stats.write(*outgoing.stats);
  if (outgoing.progress) to.progress.write(*outgoing.progress);
  for (const EventLog& event : outgoing.events.log) {
    to.event.send(event);
    if (print) print(fmt::format("{}: {}", event.kind, event.text));
  }
  if (outgoing.events.run) to.run.send(*outgoing.events.run);
  published_.last_tick = now_;
}

void ServerWire::statePublished() {
  if (published_.last_tick < published_.first_tick) return;
  published_.topics.clear();
  const auto take = [&](auto& out) {
    published_.topics.push_back({std::string(out.topic.name), std::exchange(out.samples, 0)});
  };
  std::apply([&](auto&... out) { (take(out), ...); }, writers_->ofTicks());
  writers_->published.send(published_);
  published_.last_tick = 0;
}

void ServerWire::waitForReaders(std::chrono::nanoseconds timeout) {
  const auto until = std::chrono::steady_clock::now() + timeout;
  const auto wait = [&](auto& out) {
    const auto rest = until - std::chrono::steady_clock::now();
    (void)out.writer->waitForReaders(std::max(rest, std::chrono::nanoseconds(0)));
  };
  if (copies_) copies_->finish(until);
  std::apply([&](auto&... out) { (wait(out), ...); }, writers_->inSession());
}

void ServerWire::send(const JournalEntry& entry) {
  if (copies_) copies_->add(entry);
}

}  // namespace tenon::session
