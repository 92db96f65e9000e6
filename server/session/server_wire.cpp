#include "server/session/server_wire.h"

#include <algorithm>
#include <optional>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "idl/types/messages/journal.h"
#include "idl/types/names.h"
#include "server/session/scene_loader.h"

namespace tenon::session {

/// A writer and its topic, opened together.
template <class M>
struct ServerWire::TopicWriter {
  const wire::Topic<M>& topic;
  std::optional<wire::Writer<M>> writer;
  std::uint64_t samples = 0;  ///< of ticks, since the last PublishedSamples

  /// Writes a sample of a tick.
  void write(const M& message) {
    ++samples;
    (void)writer->write(message);
  }
  Result<void> open(wire::Partition& partition) {
    auto opened = wire::Writer<M>::open(partition, topic);
    if (!opened) return fail(opened.error().what);
    writer.emplace(std::move(*opened));
    return {};
  }
};

struct ServerWire::Writers {
  TopicWriter<SessionAnnounce> announce{wire::kSessionAnnounce, {}};
  TopicWriter<Welcome> welcome{wire::kWelcome, {}};

  TopicWriter<WorldFrame> frame_1k{wire::kWorldFrame1k, {}};
  TopicWriter<WorldFrame> frame_100{wire::kWorldFrame100, {}};
  TopicWriter<WorldFrame> frame_30{wire::kWorldFrame30, {}};
  TopicWriter<HandManifold> manifold{wire::kHandManifold, {}};
  TopicWriter<ContactPairs> pairs{wire::kContactPairs100, {}};
  TopicWriter<TickStats> stats{wire::kTickStats100, {}};
  TopicWriter<ObjectSnapshot> snapshot{wire::kObjectSnapshot, {}};
  TopicWriter<SceneObject> object{wire::kSceneObject, {}};
  TopicWriter<StepState> step{wire::kStepState, {}};
  TopicWriter<StepProgress> progress{wire::kStepProgress, {}};
  TopicWriter<RunState> run{wire::kRunState, {}};
  TopicWriter<GrabState> grab{wire::kGrabState, {}};
  TopicWriter<CommandAck> ack{wire::kCommandAck, {}};
  TopicWriter<Guidance> guidance{wire::kGuidance, {}};
  TopicWriter<EventLog> event{wire::kEventLog, {}};
  TopicWriter<ClockSync> clock{wire::kClockSync, {}};
  TopicWriter<EmergencyStop> stop{wire::kEmergencyStop, {}};
  TopicWriter<PublishedSamples> published{wire::kPublishedSamples, {}};
  TopicWriter<TickInputPart> input{wire::kTickInput, {}};
  TopicWriter<CheckpointPart> checkpoint{wire::kCheckpoint, {}};

  auto inLobby() { return std::tie(announce, welcome); }
  auto inSession() {
    return std::tie(frame_1k, frame_100, frame_30, manifold, pairs, stats, snapshot, object, step, progress,
                    run, grab, ack, guidance, event, clock, stop, published, input, checkpoint);
  }
  /// Written in ticks by send(OutgoingMessages), with the tick in each sample.
  auto ofTicks() {
    return std::tie(frame_1k, frame_100, frame_30, manifold, pairs, stats, snapshot, progress, grab);
  }
};

namespace {

template <class Tuple>
Result<void> openAll(Tuple outs, wire::Partition& partition) {
  Result<void> result;
  const auto open = [&](auto& out) {
    if (!result) return;
    result = out.open(partition);
  };
  std::apply([&](auto&... out) { (open(out), ...); }, outs);
  return result;
}

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
      writers_(std::make_shared<Writers>()),
      registry_(registry),
      input_buffer_(input_buffer),
      publisher_(publisher) {}

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
  wire->newest_seq_.resize(loaded.scenario->hands.size());
  if (auto opened = wire->openWriters(); !opened) return fail(opened.error().what);
  if (auto opened = wire->openReaders(); !opened) return fail(opened.error().what);
  wire->sendScene(loaded);
  wire->announce();
  return wire;
}

Result<void> ServerWire::openWriters() {
  if (auto opened = openAll(writers_->inLobby(), lobby_); !opened) return opened;
  return openAll(writers_->inSession(), session_);
}

Result<void> ServerWire::openReaders() {
  Result<void> result;
  const auto listenTo = [&]<class M>(wire::Partition& partition, const wire::Topic<M>& topic, auto handler) {
    if (result) result = inbox_.onFrom<M>(partition, topic, handler);
  };
  listenTo(lobby_, wire::kJoin, [this](const Join& join, const wire::Origin& from) { handle(join, from); });
  listenTo(session_, wire::kDeviceInput,
           [this](const DeviceInput& input, const wire::Origin& from) { handle(input, from); });
  listenTo(session_, wire::kCommand,
           [this](const Command& command, const wire::Origin& from) { handle(command, from); });
  listenTo(session_, wire::kClockSync, [this](const ClockSync& sync, const wire::Origin&) { handle(sync); });
  listenTo(session_, wire::kEmergencyStop,
           [this](const EmergencyStop& stop, const wire::Origin& from) { handle(stop, from); });
  const auto take = [this](const Result<Change>& change) {
    if (!change) return refuse(change.error().what);
    input_buffer_.put(*change);
  };
  listenTo(session_, wire::kForceContribution,
           [this, take](const ForceContribution& force, const wire::Origin& from) {
             if (isGenuine(force.client, from, "force")) take(registry_.validateForceContribution(force));
           });
  listenTo(session_, wire::kExternalPose, [this, take](const ExternalPose& pose, const wire::Origin& from) {
    if (isGenuine(pose.client, from, "pose")) take(registry_.validateExternalPose(pose));
  });
  if (result) {
    result = inbox_.onGoneFrom<Presence>(
        session_, wire::kPresence,
        [this](const Presence& gone, const wire::Origin& from) { handleGone(gone, from); });
  }
  return result;
}

void ServerWire::sendScene(const LoadedScene& loaded) {
  for (std::uint32_t i = 0; i < loaded.scene->objects.size(); ++i) {
    (void)writers_->object.writer->write(describe(ObjectId{i}, loaded.scene->objects[i]));
  }
}

void ServerWire::announce() {
  (void)writers_->announce.writer->write({.session = options_.session,
                                          .title = title_,
                                          .server_epoch = options_.server_epoch,
                                          .lockstep = options_.lockstep,
                                          .scenario_hash = scenario_hash_,
                                          .free_hands = registry_.freeHands()});
}

void ServerWire::dispatch(std::chrono::nanoseconds timeout) {
  inbox_.dispatch(timeout);
  forwardChanges();
}

void ServerWire::forwardChanges() {
  // while the queue is nearly full they stay in the registry, until the tick has caught up
  if (input_buffer_.freeChanges() < kMaxChanges) return;
  FixedVector<Change, kMaxChanges> changes;
  registry_.takeChanges(changes);
  for (const Change& change : changes) input_buffer_.put(change);
}

void ServerWire::update(const TickOutput& output) {
  now_ = output.tick;
  registry_.updatePhase(output.phase, output.emergency_stop);
}

void ServerWire::log(Severity severity, const std::string& kind, const std::string& text) {
  send(publisher_.eventGenerator().makeEvent(severity, kind, text));
  if (print) print(text);
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
  (void)writers_->welcome.writer->write({.client_guid = registry_.guidOf(client),
                                         .accepted = false,
                                         .reason = why,
                                         .client = client,
                                         .server_epoch = options_.server_epoch,
                                         .tick = now_});
}

void ServerWire::handle(const Join& join, const wire::Origin& from) {
  const bool is_new =
      registry_.clients().empty() || join.client_guid.empty() ||
      std::none_of(registry_.clients().begin(), registry_.clients().end(), [&](const Presence& who) {
        return who.alive && registry_.guidOf(who.client) == join.client_guid;
      });
  const std::size_t seats = registry_.clients().size();
  const Welcome welcome = registry_.join(join, now_, from);
  (void)writers_->welcome.writer->write(welcome);
  if (!is_new) return;
  for (const HandId hand : welcome.hands)
    if (hand.valid()) newest_seq_[hand.value] = 0;
  const char* how = registry_.clients().size() == seats ? "has rejoined" : "has joined";
  log(welcome.accepted ? Severity::kInfo : Severity::kWarning, "join",
      welcome.accepted ? fmt::format("{} ({}) {}", join.name, roleName(join.role), how)
                       : fmt::format("{} may not join: {}", join.name, welcome.reason));
  announce();
}

void ServerWire::handle(const DeviceInput& input, const wire::Origin& from) {
  if (!isGenuine(input.client, from, "device input")) return;
  const Presence* sender = registry_.findClient(input.client);
  if (sender != nullptr && !sender->alive && input.server_epoch == options_.server_epoch)
    return notifySeatLost(input.client, "its process or link was lost");
  const auto reading = registry_.validateDeviceInput(input);
  if (!reading) return refuse(reading.error().what);
  std::uint32_t& newest = newest_seq_[input.hand.value];
  if (options_.lockstep && reading->seq == newest && newest == now_) resend_requested_ = true;
  if (reading->seq <= newest && newest - reading->seq < 0x80000000U) return;  // out of order, or a repetition
  if (options_.lockstep && reading->seq > now_ + 1)
    return dismiss(input.client,
                   fmt::format("sent the input of tick {} when tick {} was the next, and is removed: in "
                               "lockstep an input answers a received tick",
                               reading->seq, now_ + 1));
  newest = reading->seq;
  input_buffer_.put(*reading);
}

void ServerWire::handle(const Command& command, const wire::Origin& from) {
  if (!isGenuine(command.client, from, "command")) return;
  if (const CommandAck* again = registry_.previousAck(command)) {
    (void)writers_->ack.writer->write(*again);
    return;
  }
  const CommandAck ack = registry_.handleCommand(command);
  (void)writers_->ack.writer->write(ack);
  if (!ack.accepted) {
    log(Severity::kWarning, "refused",
        fmt::format("command of client {}: {}", command.client.value, ack.reason));
  } else if (command.kind == CommandKind::kClearEmergencyStop) {
    endEmergencyStop(command.client, command.text);
  }
}

/// The server publishes an engaged stop itself, for late joiners and in case its writer leaves, and ignores
/// its own samples. Any participant may engage the stop; clearing it takes a command by instructor or admin,
/// and devices accept it from the server alone.
void ServerWire::handle(const EmergencyStop& stop, const wire::Origin& from) {
  if (from == participant_->origin() || (stop.engaged == emergency_stop_ && stop.engaged)) return;
  if (!stop.engaged) {
    if (!emergency_stop_) return;
    refuse(
        fmt::format("{} may not clear the emergency stop: it takes a command of the instructor", stop.who));
    (void)writers_->stop.writer->write({true, "server", "the emergency stop stays engaged"});
    return;
  }
  emergency_stop_ = true;
  registry_.setEmergencyStop(stop);
  (void)writers_->stop.writer->write(stop);
  log(Severity::kError, "emergency stop", fmt::format("engaged by {}: {}", stop.who, stop.reason));
}

void ServerWire::endEmergencyStop(ClientId client, const std::string& reason) {
  emergency_stop_ = false;
  const std::string& who = registry_.findClient(client)->name;
  (void)writers_->stop.writer->write({false, who, reason});
  log(Severity::kInfo, "emergency stop", fmt::format("cleared by {}: {}", who, reason));
}

void ServerWire::handle(const ClockSync& sync) {
  if (sync.server_sent_ns != 0) return;  // the server's own answer
  ClockSync answer = sync;
  answer.server_received_ns = nowNanoseconds();
  answer.server_sent_ns = nowNanoseconds();
  (void)writers_->clock.writer->write(answer);
}

void ServerWire::handleGone(const Presence& presence, const wire::Origin& from) {
  if (from.known() && !isGenuine(presence.client, from, "departure notice")) return;
  dismiss(presence.client, "has left");
}

void ServerWire::dismiss(ClientId client, const std::string& why) {
  const Presence* leaver = registry_.findClient(client);
  if (leaver == nullptr || !leaver->alive) return;
  const std::string text = fmt::format("{} ({}) {}", leaver->name, roleName(leaver->role), why);
  registry_.leave(client);
  notifySeatLost(client, why);
  log(Severity::kWarning, "leave", text);
  forwardChanges();
  announce();
}

void ServerWire::send(const EventLog& event) { (void)writers_->event.writer->write(event); }

void ServerWire::send(const RunState& run) { (void)writers_->run.writer->write(run); }

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
  Writers& to = *writers_;
  // the step before the frames, which refer to its revision
  if (outgoing.events.step) (void)to.step.writer->write(*outgoing.events.step);
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
    (void)to.event.writer->write(event);
    if (print) print(fmt::format("{}: {}", event.kind, event.text));
  }
  if (outgoing.events.run) (void)to.run.writer->write(*outgoing.events.run);
  published_.last_tick = now_;
}

void ServerWire::statePublished() {
  if (published_.last_tick < published_.first_tick) return;
  published_.topics.clear();
  const auto take = [&](auto& out) {
    published_.topics.push_back({std::string(out.topic.name), std::exchange(out.samples, 0)});
  };
  std::apply([&](auto&... out) { (take(out), ...); }, writers_->ofTicks());
  (void)writers_->published.writer->write(published_);
  published_.last_tick = 0;
}

void ServerWire::waitForReaders(std::chrono::nanoseconds timeout) {
  const auto until = std::chrono::steady_clock::now() + timeout;
  const auto wait = [&](auto& out) {
    const auto rest = until - std::chrono::steady_clock::now();
    (void)out.writer->waitForReaders(std::max(rest, std::chrono::nanoseconds(0)));
  };
  std::apply([&](auto&... out) { (wait(out), ...); }, writers_->inSession());
}

void ServerWire::send(const JournalEntry& entry) {
  if (!options_.publish_journal) return;
  if (writers_->input.writer->matchedReaders() > 0) {
    std::vector<std::uint8_t> bytes;
    appendBytes(entry.input, bytes);
    forEachPart<TickInputPart>(entry.input.tick, entry.hash, bytes,
                               [&](const auto& part) { (void)writers_->input.writer->write(part); });
  }
  if (!entry.checkpoint.empty() && writers_->checkpoint.writer->matchedReaders() > 0)
    forEachPart<CheckpointPart>(entry.input.tick, entry.hash, entry.checkpoint,
                                [&](const auto& part) { (void)writers_->checkpoint.writer->write(part); });
}

}  // namespace tenon::session
