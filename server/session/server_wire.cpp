#include "server/session/server_wire.h"

#include <algorithm>
#include <optional>
#include <tuple>
#include <utility>

#include <fmt/format.h>
#include <unistd.h>

#include "idl/types/messages/journal.h"
#include "idl/types/names.h"
#include "idl/types/printable_text.h"
#include "server/session/scene_loader.h"
#include "server/session/session_lock.h"

namespace tenon::session {
namespace {

constexpr std::size_t kMostScenarioName = 63;  // [bytes] of SessionAnnounce in idl/tenon.idl

SessionAnnounce announcementOf(const WireOptions& options, const LoadedScene& loaded) {
  const game_control::ScenarioFile& scenario = *loaded.scenario;
  return {.session = options.session,
          .server_epoch = options.server_epoch,
          .title = scenario.title.front().text,
          .lockstep = options.lockstep,
          .objects = static_cast<std::uint32_t>(loaded.scene->objects.size()),
          .hands = static_cast<std::uint32_t>(scenario.hands.size()),
          .steps = static_cast<std::uint32_t>(scenario.states.size()),
          .resumed_after = options.resumed_after,
          .scenario_hash = fmt::format("{:016x}", scenario.text_hash),
          .host = hostName(),
          .pid = static_cast<std::uint32_t>(getpid()),
          .scene_hash = options.scene_hash,
          .scenario = shortened(scenarioName(scenario.path), kMostScenarioName),
          .detail = options.detail,
          .freeze_ticks = static_cast<std::uint32_t>(options.limits.freeze),
          .park_ticks = static_cast<std::uint32_t>(options.limits.park)};
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
      publisher_(publisher),
      stops_(options.stop_file, *writers_, options.server_epoch) {
  stops_.not_kept = [this](const std::string& why) {
    log(Severity::kError, "emergency stop",
        fmt::format("{} a crash of the server: {}",
                    stops_.engaged() ? "the emergency stop would not outlive"
                                     : "the emergency stop is over, but would stand again after",
                    why));
  };
  if (options_.publish_journal) copies_ = std::make_unique<JournalCopies>(participant_, options_.session);
  if (!options_.seat_file.empty()) seats_ = std::make_unique<SeatKeeper>(options_.seat_file);
  reception_ =
      std::make_unique<Reception>(Reception::Session{options_.session, options_.server_epoch, options_.key},
                                  registry_, *writers_, seats_.get(), copies_.get());
  reception_->callbacks = {.log = [this](Severity severity, const std::string& kind,
                                         const std::string& text) { log(severity, kind, text); },
                           .seated = [this](const Welcome& welcome) { beginInputs(welcome); },
                           .left =
                               [this](ClientId client) {
                                 contributions_.end(client);
                                 forwardChanges();
                               },
                           .answer = [this](const Command& command, const CommandAck& ack,
                                            const std::string& who) { answer(command, ack, who); }};
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
  wire->newest_seq_.resize(loaded.scenario->hands.size());
  if (auto alone = ServerAnnouncement::refuseBesideAnother(wire->lobby_, options.session); !alone)
    return fail(alone.error().what);
  for (std::uint32_t i = 0; i < loaded.scenario->hands.size(); ++i)
    wire->hands_.emplace_back(wire->participant_, wire::handPartition(options.session, HandId{i}));
  if (auto opened = wire->writers_->open(wire->lobby_, wire->session_, wire->hands_, wire->writes_); !opened)
    return fail(opened.error().what);
  if (auto opened = wire->openReaders(); !opened) return fail(opened.error().what);
  wire->sendScene(loaded);
  if (auto restored = wire->stops_.restore(); !restored) return fail(restored.error().what);
  if (wire->stops_.engaged()) registry.engageEmergencyStop();
  wire->announcement_.emplace(announcementOf(options, loaded), *wire->writers_);
  wire->announcement_->announce();
  return wire;
}

void ServerWire::handle(const SessionAnnounce& other, const wire::Origin& from) {
  if (!from.known() || from == participant_->origin() || !announcement_->isAnother(other)) return;
  log(Severity::kWarning, "another server",
      fmt::format(
          "another server of session '{}' runs as process {} on host {}: clients of this one ignore it",
          other.session, other.pid, other.host));
}

Result<void> ServerWire::openReaders() {
  Result<void> result;
  const auto listenTo = [&]<class M>(wire::Partition& partition, const wire::Topic<M>& topic, auto handler) {
    if (result) result = inbox_.onFrom<M>(partition, topic, handler);
  };
  listenTo(lobby_, wire::kJoin,
           [this](const Join& join, const wire::Origin& from) { reception_->receive(join, from); });
  listenTo(session_, wire::kDeviceInput,
           [this](const DeviceInput& input, const wire::Origin& from) { handle(input, from); });
  listenTo(session_, wire::kCommand,
           [this](const Command& command, const wire::Origin& from) { handle(command, from); });
  listenTo(session_, wire::kClockSync, [this](const ClockSync& sync, const wire::Origin& from) {
    if (registry_.ownsSeat(sync.client, from)) handle(sync);
  });
  listenTo(session_, wire::kTelemetry, [this](const Telemetry& telemetry, const wire::Origin& from) {
    const Presence* const sender = registry_.findClient(telemetry.client);
    if (sender == nullptr)
      return refuse(fmt::format("telemetry of unknown client {}", telemetry.client.value));
    // nobody is on the seat: of a station that is on its way back from an earlier life of the server
    if (sender->alive && isGenuine(telemetry.client, from, "telemetry")) handle(telemetry);
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
  listenTo(session_, wire::kPresence, [this](const Presence& presence, const wire::Origin& from) {
    if (registry_.ownsSeat(presence.client, from)) reception_->handlePresent(presence.client);
  });
  if (result) {
    result = inbox_.onGoneFrom<Presence>(
        session_, wire::kPresence,
        [this](const Presence& gone, const wire::Origin& from) { handleGone(gone, from); });
  }
  if (result) {
    result = inbox_.onGone<SessionAnnounce>(
        lobby_, wire::kSessionAnnounce, [this](const SessionAnnounce& gone) { announcement_->forget(gone); });
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
  for (std::uint32_t i = 0; i < steps; ++i) {
    const game_control::ScenarioState& state = scenario.states[i];
    writers_->scene_step.send({i, steps, state.name, state.title, state.part});
  }
  writers_->scene_title.send({scenario.title});
  for (std::uint32_t i = 0; i < scenario.signals.size(); ++i)
    writers_->scene_signal.send({i, scenario.signals[i]});
}

void ServerWire::dispatch(std::chrono::nanoseconds timeout) {
  const bool waits = reception_->waits() || stops_.waits();
  inbox_.dispatch(waits ? std::min<std::chrono::nanoseconds>(timeout, Reception::kBetweenTurns) : timeout);
  reception_->step();
  stops_.step();
  if (const auto error = seats_ ? seats_->takeError() : std::nullopt) log(Severity::kError, "seats", *error);
  if (const auto line = refusals_.step(std::chrono::steady_clock::now()))
    log(Severity::kWarning, "refused", *line);
  announcement_->step();
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
  reception_->setTick(now_);
  registry_.updatePhase(output.phase);
  const bool is_in_step = output.step.phase == StepPhase::kActive;
  registry_.updateStep(is_in_step ? std::optional(output.step.step) : std::nullopt);
  registry_.updateCommands(output.commands);
  for (const std::string& text : registry_.takeDroppedCommands()) log(Severity::kWarning, "dropped", text);
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
  logRefusal(why);
}

void ServerWire::logRefusal(const std::string& why) {
  if (const auto line = refusals_.add(why, std::chrono::steady_clock::now()))
    log(Severity::kWarning, "refused", *line);
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

void ServerWire::handle(const Command& command, const wire::Origin& from) {
  if (!isGenuine(command.client, from, "command")) return;
  if (const CommandAck* again = registry_.previousAck(command)) {
    if (!reception_->holds(command)) writers_->ack.send(*again);
    return;
  }
  const Presence* sender = registry_.findClient(command.client);
  const std::string who = sender != nullptr ? sender->name : fmt::format("client {}", command.client.value);
  const CommandAck ack = registry_.handleCommand(command, stops_.newest());
  if (!reception_->dismissKicked(command, ack, who)) answer(command, ack, who);
}

void ServerWire::answer(const Command& command, const CommandAck& ack, const std::string& who) {
  writers_->ack.send(ack);
  if (!ack.accepted) {
    logRefusal(fmt::format("{}: '{}': {}", who, commandName(command.kind), ack.reason));
  } else if (command.kind == CommandKind::kNote) {
    log(Severity::kInfo, "note", fmt::format("{}: {}", who, command.text));
  } else if (command.kind == CommandKind::kClearEmergencyStop) {
    clearEmergencyStop(command, who);
  } else {
    log(Severity::kInfo, "command", commandText(command, who));
  }
}

/// Anybody may raise the stop.
void ServerWire::handle(const EmergencyStop& stop, const wire::Origin& from) {
  if (from != participant_->origin()) engage(stop);
}

void ServerWire::raiseStop(const std::string& reason) {
  if (!registry_.isStopEngaged()) engage(stops_.ownRaise(reason));
}

void ServerWire::engage(const EmergencyStop& stop) {
  const StopChange change = stops_.raise(stop);
  if (!change) return;
  registry_.engageEmergencyStop();
  forwardChanges();
  stops_.publish(stop, change);
  const std::string text = fmt::format("engaged by {}: {}", stop.who, stop.reason);
  // of somebody who raises it without end, at a bounded rate
  const bool is_first = !change.superfluous && !change.ended;
  if (is_first || refusals_.add(text, std::chrono::steady_clock::now()))
    log(Severity::kError, "emergency stop", text);
}

void ServerWire::logStandingStops() {
  if (!stops_.engaged()) return;
  const NewestRaise& one = stops_.newest();
  const std::uint32_t others = one.standing > 2 ? one.standing - 2 : 0;  // but that of this server
  log(Severity::kError, "emergency stop",
      fmt::format("an emergency stop raised before this server's start still stands: engaged by {}: {}{}",
                  one.who, one.reason, others == 0 ? "" : fmt::format(", and {} more", others)));
}

void ServerWire::clearEmergencyStop(const Command& command, const std::string& who) {
  const std::string& reason = command.text;
  stops_.clear(who, reason);
  const char* const next = registry_.phase() == RunPhase::kWaitingForPeople
                               ? "the session still waits for people"
                               : "the session is paused until 'resume'";
  log(Severity::kInfo, "emergency stop",
      fmt::format("cleared by {}: {}{}{}", who, reason, reason.empty() ? "" : "; ", next));
}

void ServerWire::handleGone(const Presence& presence, const wire::Origin& from) {
  if (from.known() && !isGenuine(presence.client, from, "departure notice")) return;
  reception_->handleGone(presence.client);
}

void ServerWire::send(const EventLog& event) { writers_->event.send(event); }

void ServerWire::send(const RunState& run) { writers_->run.send(run); }

const HandManifold& ServerWire::numbered(const HandManifold& manifold, std::vector<std::uint32_t>& sent) {
  if (sent.size() <= manifold.hand.value) sent.resize(manifold.hand.value + 1);
  numbered_ = manifold;
  numbered_.sent = ++sent[manifold.hand.value];
  return numbered_;
}

void ServerWire::resendLast() {
  if (last_ == nullptr) return;
  // a repeated sample is no further one of its tick: PublishedSamples is the same on any machine
  for (const WorldFrame& frame : last_->frames) writers_->frame_1k.send(frame);
  for (const HandManifold* manifold : last_->manifolds) writers_->manifold.send(numbered(*manifold, sent_));
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
  for (const HandManifold* manifold : outgoing.manifolds) to.manifold.write(numbered(*manifold, sent_));
  for (const WorldFrame& frame : outgoing.frames_100) to.frame_100.write(frame);
  for (const HandManifold* manifold : outgoing.manifolds_50)
    to.manifold_50.send(numbered(*manifold, sent_50_));
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
  const auto wait = [&](auto& writer) {
    const auto rest = until - std::chrono::steady_clock::now();
    (void)writer.waitForReaders(std::max(rest, std::chrono::nanoseconds(0)));
  };
  if (copies_) copies_->finish(until);
  std::apply([&](auto&... out) { (wait(*out.writer), ...); }, writers_->inSession());
  const auto wait_each = [&](HandWriters& out) {
    std::for_each(out.writers.begin(), out.writers.end(), wait);
  };
  std::apply([&](auto&... out) { (wait_each(out), ...); }, writers_->ofHands());
}

void ServerWire::send(const JournalEntry& entry) {
  if (copies_) copies_->add(entry);
}

}  // namespace tenon::session
