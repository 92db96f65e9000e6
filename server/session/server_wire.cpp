#include "server/session/server_wire.h"

#include <algorithm>
#include <optional>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "idl/types/names.h"
#include "server/session/scene_loader.h"

namespace tenon {

/// A writer and its topic, opened together.
template <class M>
struct ServerWire::Out {
  const Topic<M>& topic;
  std::optional<Writer<M>> writer;

  Result<void> open(Partition& partition) {
    auto opened = Writer<M>::open(partition, topic);
    if (!opened) return fail(opened.error().what);
    writer.emplace(std::move(*opened));
    return {};
  }
};

struct ServerWire::Writers {
  Out<SessionAnnounce> announce{kSessionAnnounce, {}};
  Out<Welcome> welcome{kWelcome, {}};

  Out<WorldFrame> frame_1k{kWorldFrame1k, {}};
  Out<WorldFrame> frame_100{kWorldFrame100, {}};
  Out<WorldFrame> frame_30{kWorldFrame30, {}};
  Out<HandManifold> manifold{kHandManifold, {}};
  Out<ContactPairs> pairs{kContactPairs100, {}};
  Out<TickStats> stats{kTickStats100, {}};
  Out<ObjectSnapshot> snapshot{kObjectSnapshot, {}};
  Out<SceneObject> object{kSceneObject, {}};
  Out<StepState> step{kStepState, {}};
  Out<StepProgress> progress{kStepProgress, {}};
  Out<RunState> run{kRunState, {}};
  Out<GrabState> grab{kGrabState, {}};
  Out<CommandAck> ack{kCommandAck, {}};
  Out<Guidance> guidance{kGuidance, {}};
  Out<EventLog> event{kEventLog, {}};
  Out<ClockSync> clock{kClockSync, {}};
  Out<EmergencyStop> stop{kEmergencyStop, {}};
  Out<TickInputPart> input{kTickInput, {}};
  Out<CheckpointPart> checkpoint{kCheckpoint, {}};

  auto inLobby() { return std::tie(announce, welcome); }
  auto inSession() {
    return std::tie(frame_1k, frame_100, frame_30, manifold, pairs, stats, snapshot, object, step, progress,
                    run, grab, ack, guidance, event, clock, stop, input, checkpoint);
  }
};

namespace {

template <class Tuple>
Result<void> openAll(Tuple outs, Partition& partition) {
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

ServerWire::ServerWire(const WireOptions& options, std::shared_ptr<Participant> participant, FrontDesk& desk,
                       Intake& intake, Broadcast& broadcast)
    : options_(options),
      participant_(std::move(participant)),
      lobby_(participant_, kLobby, LinkProfile::kLan),
      session_(participant_, sessionPartition(options.session)),
      writers_(std::make_shared<Writers>()),
      desk_(desk),
      intake_(intake),
      broadcast_(broadcast) {}

Result<std::unique_ptr<ServerWire>> ServerWire::open(const WireOptions& options, const LoadedScene& loaded,
                                                     FrontDesk& desk, Intake& intake, Broadcast& broadcast) {
  auto participant =
      Participant::open({.domain = options.domain,
                         .profile = options.lockstep ? LinkProfile::kLockstep : LinkProfile::kLan,
                         .config = {}});
  if (!participant) return fail(participant.error().what);
  std::unique_ptr<ServerWire> wire(new ServerWire(options, std::move(*participant), desk, intake, broadcast));
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
  const auto listenTo = [&]<class M>(Partition& partition, const Topic<M>& topic, auto handler) {
    if (result) result = inbox_.onFrom<M>(partition, topic, handler);
  };
  listenTo(lobby_, kJoin, [this](const Join& join, const Origin& from) { hear(join, from); });
  listenTo(session_, kDeviceInput,
           [this](const DeviceInput& input, const Origin& from) { hear(input, from); });
  listenTo(session_, kCommand, [this](const Command& command, const Origin& from) { hear(command, from); });
  listenTo(session_, kClockSync, [this](const ClockSync& sync, const Origin&) { hear(sync); });
  listenTo(session_, kEmergencyStop,
           [this](const EmergencyStop& stop, const Origin& from) { hear(stop, from); });
  const auto take = [this](const Result<Change>& change) {
    if (!change) return refuse(change.error().what);
    intake_.put(*change);
  };
  listenTo(session_, kForceContribution, [this, take](const ForceContribution& force, const Origin& from) {
    if (isGenuine(force.client, from, "force")) take(desk_.contribution(force));
  });
  listenTo(session_, kExternalPose, [this, take](const ExternalPose& pose, const Origin& from) {
    if (isGenuine(pose.client, from, "pose")) take(desk_.externalPose(pose));
  });
  if (result) {
    result = inbox_.onGoneFrom<Presence>(
        session_, kPresence, [this](const Presence& gone, const Origin& from) { heardGone(gone, from); });
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
                                          .free_hands = desk_.freeHands()});
}

void ServerWire::listen(std::chrono::nanoseconds timeout) {
  inbox_.dispatch(timeout);
  passChanges();
}

void ServerWire::passChanges() {
  if (intake_.room() < kMaxChanges) return;  // the desk keeps them until the tick has caught up
  FixedVector<Change, kMaxChanges> changes;
  desk_.takeChanges(changes);
  for (const Change& change : changes) intake_.put(change);
}

void ServerWire::follow(const TickOutput& output) {
  now_ = output.tick;
  desk_.follow(output.phase, output.emergency_stop);
}

void ServerWire::note(Severity severity, const std::string& kind, const std::string& text) {
  send(broadcast_.chronicle().event(severity, kind, text));
  if (say) say(text);
}

void ServerWire::refuse(const std::string& why) {
  ++refused_inputs_;
  constexpr std::size_t kManySentences = 100;
  if (said_.size() < kManySentences && said_.insert(why).second) note(Severity::kWarning, "refused", why);
}

/// Whether the program that took the client's seat wrote this. A sample that claims another's id is refused.
bool ServerWire::isGenuine(ClientId client, const Origin& from, const std::string& what) {
  if (desk_.person(client) == nullptr || desk_.isFrom(client, from))
    return true;     // the desk knows the unknown
  if (from.known())  // else its writer has gone in the meantime
    refuse(
        fmt::format("a {} under the id of client {} came from another program than the one that joined: "
                    "ignored",
                    what, client.value));
  return false;
}

/// To a program that goes on as if it had a seat still: it may come back with its token.
void ServerWire::tellLost(ClientId client, const std::string& why) {
  constexpr auto kOnceIn = std::chrono::seconds(1);
  const auto now = std::chrono::steady_clock::now();
  const auto told = told_lost_.find(client);
  if (told != told_lost_.end() && now - told->second < kOnceIn) return;
  told_lost_[client] = now;
  (void)writers_->welcome.writer->write({.client_guid = desk_.guidOf(client),
                                         .accepted = false,
                                         .reason = why,
                                         .client = client,
                                         .server_epoch = options_.server_epoch,
                                         .tick = now_});
}

void ServerWire::hear(const Join& join, const Origin& from) {
  const bool is_new = desk_.people().empty() || join.client_guid.empty() ||
                      std::none_of(desk_.people().begin(), desk_.people().end(), [&](const Presence& who) {
                        return who.alive && desk_.guidOf(who.client) == join.client_guid;
                      });
  const std::size_t seats = desk_.people().size();
  const Welcome welcome = desk_.join(join, now_, from);
  (void)writers_->welcome.writer->write(welcome);
  if (!is_new) return;
  for (const HandId hand : welcome.hands)
    if (hand.valid()) newest_seq_[hand.value] = 0;
  const char* how = desk_.people().size() == seats ? "is here again" : "is here";
  note(welcome.accepted ? Severity::kInfo : Severity::kWarning, "join",
       welcome.accepted ? fmt::format("{} ({}) {}", join.name, roleName(join.role), how)
                        : fmt::format("{} may not join: {}", join.name, welcome.reason));
  announce();
}

void ServerWire::hear(const DeviceInput& input, const Origin& from) {
  if (!isGenuine(input.client, from, "device input")) return;
  const Presence* who = desk_.person(input.client);
  if (who != nullptr && !who->alive && input.server_epoch == options_.server_epoch)
    return tellLost(input.client, "it was not heard for too long");
  const auto reading = desk_.reading(input);
  if (!reading) return refuse(reading.error().what);
  std::uint32_t& newest = newest_seq_[input.hand.value];
  if (options_.lockstep && reading->seq == newest && newest == now_) repeat_wish_ = true;
  if (reading->seq <= newest && newest - reading->seq < 0x80000000U) return;  // overtaken, or heard already
  if (options_.lockstep && reading->seq > now_ + 1)
    return dismiss(input.client,
                   fmt::format("sent the input of tick {} when tick {} was the next, and is taken out: in "
                               "lockstep an input answers a tick that was heard",
                               reading->seq, now_ + 1));
  newest = reading->seq;
  intake_.put(*reading);
}

void ServerWire::hear(const Command& command, const Origin& from) {
  if (!isGenuine(command.client, from, "command")) return;
  if (const CommandAck* again = desk_.answerTo(command)) {
    (void)writers_->ack.writer->write(*again);
    return;
  }
  const CommandAck ack = desk_.command(command);
  (void)writers_->ack.writer->write(ack);
  if (!ack.accepted) {
    note(Severity::kWarning, "refused",
         fmt::format("command of client {}: {}", command.client.value, ack.reason));
  } else if (command.kind == CommandKind::kClearEmergencyStop) {
    endEmergencyStop(command.client, command.text);
  }
}

/// Whoever stops may leave: the server says it again for late joiners. It hears itself. Anybody may stop, but
/// going on is a command to be allowed, and devices believe it of the server alone.
void ServerWire::hear(const EmergencyStop& stop, const Origin& from) {
  if (from == participant_->origin() || (stop.engaged == stopped_ && stop.engaged)) return;
  if (!stop.engaged) {
    if (!stopped_) return;
    refuse(fmt::format("{} may not clear the emergency stop like that: it takes a command of the instructor",
                       stop.who));
    (void)writers_->stop.writer->write({true, "server", "the emergency stop goes on"});
    return;
  }
  stopped_ = true;
  desk_.emergencyStop(stop);
  (void)writers_->stop.writer->write(stop);
  note(Severity::kError, "emergency stop", fmt::format("engaged by {}: {}", stop.who, stop.reason));
}

void ServerWire::endEmergencyStop(ClientId client, const std::string& reason) {
  stopped_ = false;
  const std::string& who = desk_.person(client)->name;
  (void)writers_->stop.writer->write({false, who, reason});
  note(Severity::kInfo, "emergency stop", fmt::format("cleared by {}: {}", who, reason));
}

void ServerWire::hear(const ClockSync& sync) {
  if (sync.server_sent_ns != 0) return;  // our own answer
  ClockSync answer = sync;
  answer.server_received_ns = nowNanoseconds();
  answer.server_sent_ns = nowNanoseconds();
  (void)writers_->clock.writer->write(answer);
}

void ServerWire::heardGone(const Presence& presence, const Origin& from) {
  if (from.known() && !isGenuine(presence.client, from, "good-bye")) return;
  dismiss(presence.client, "is gone");
}

void ServerWire::dismiss(ClientId client, const std::string& why) {
  const Presence* who = desk_.person(client);
  if (who == nullptr || !who->alive) return;
  const std::string text = fmt::format("{} ({}) {}", who->name, roleName(who->role), why);
  desk_.leave(client);
  tellLost(client, why);
  note(Severity::kWarning, "leave", text);
  passChanges();
  announce();
}

void ServerWire::send(const EventLog& event) { (void)writers_->event.writer->write(event); }

void ServerWire::send(const RunState& run) { (void)writers_->run.writer->write(run); }

void ServerWire::sendAgain() {
  if (last_ == nullptr) return;
  for (const WorldFrame& frame : last_->frames) (void)writers_->frame_1k.writer->write(frame);
  for (const HandManifold* manifold : last_->manifolds) (void)writers_->manifold.writer->write(*manifold);
}

void ServerWire::send(const Outgoing& outgoing) {
  last_ = &outgoing;
  Writers& to = *writers_;
  // states first: a frame names the step it belongs to
  if (outgoing.news.step) (void)to.step.writer->write(*outgoing.news.step);
  for (const GrabState& grab : outgoing.news.grabs) (void)to.grab.writer->write(grab);
  for (const ObjectSnapshot& snapshot : outgoing.news.snapshots) (void)to.snapshot.writer->write(snapshot);
  for (const WorldFrame& frame : outgoing.frames) (void)to.frame_1k.writer->write(frame);
  for (const HandManifold* manifold : outgoing.manifolds) (void)to.manifold.writer->write(*manifold);
  for (const WorldFrame& frame : outgoing.frames_100) (void)to.frame_100.writer->write(frame);
  for (const WorldFrame& frame : outgoing.frames_30) (void)to.frame_30.writer->write(frame);
  for (const ContactPairs& pairs : outgoing.pairs) (void)to.pairs.writer->write(pairs);
  if (outgoing.stats) (void)to.stats.writer->write(*outgoing.stats);
  if (outgoing.progress) (void)to.progress.writer->write(*outgoing.progress);
  for (const EventLog& event : outgoing.news.events) {
    (void)to.event.writer->write(event);
    if (say) say(fmt::format("{}: {}", event.kind, event.text));
  }
  if (outgoing.news.run) (void)to.run.writer->write(*outgoing.news.run);
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

}  // namespace tenon
