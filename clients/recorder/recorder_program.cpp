#include "clients/recorder/recorder_program.h"

#include <cstdio>
#include <memory>
#include <random>
#include <thread>
#include <utility>

#include "clients/recorder/recording.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/tap.h"

namespace tenon {

namespace {
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;
constexpr milliseconds kAskAgain{500};
constexpr milliseconds kQuiet{300};        // nothing more comes after this long
constexpr milliseconds kLongestEnd{3000};  // of a session whose clients do not fall silent
constexpr milliseconds kStatusEvery{1000};

/// Checkpoints before inputs: of a batch, what a re-run starts from comes before what it goes on with.
std::vector<std::string> topicsInOrder() {
  std::vector<std::string> topics{std::string(kCheckpoint.name)};
  for (const TopicName& name : allTopics())
    if (name.topic != kCheckpoint.name) topics.emplace_back(name.topic);
  return topics;
}

class Recorder {
 public:
  Recorder(const RecorderOptions& options, const std::atomic<bool>& stop) : options_(options), stop_(stop) {}

  Result<RecorderStatus> run() {
    auto done = findSession();
    if (done) done = listen();
    if (done) done = ask();
    if (done) done = watch();
    const Result<void> closed = recording_ ? recording_->close() : Result<void>{};
    leave();
    if (!done) return fail(done.error().what);
    if (!closed) return fail(closed.error().what);
    return recording_->status();
  }

 private:
  Result<void> findSession();
  Result<void> listen();
  Result<void> ask();
  Result<void> watch();
  void leave();
  std::size_t take(milliseconds timeout) {
    return tap_->dispatch(timeout, [this](const RawSample& sample) { recording_->add(sample); });
  }

  const RecorderOptions& options_;
  const std::atomic<bool>& stop_;
  std::unique_ptr<Partition> lobby_;
  std::unique_ptr<Partition> session_;
  SessionAnnounce announce_;
  Presence presence_;
  std::unique_ptr<Recording> recording_;
  std::unique_ptr<Tap> tap_;
  std::unique_ptr<Writer<Presence>> presence_writer_;
  std::unique_ptr<Writer<RecorderStatus>> status_writer_;
};

Result<void> Recorder::findSession() {
  auto participant =
      Participant::open({.domain = options_.domain, .profile = LinkProfile::kLan, .config = {}});
  if (!participant) return fail(participant.error().what);
  lobby_ = std::make_unique<Partition>(*participant, kLobby);
  auto reader = Reader<SessionAnnounce>::open(*lobby_, kSessionAnnounce);
  if (!reader) return fail(reader.error().what);
  const std::string wanted = options_.session.empty() ? "a session" : "session '" + options_.session + "'";
  bool found = false;
  for (const auto until = Clock::now() + options_.patience; !found && !stop_ && Clock::now() < until;) {
    while (!found && reader->take(announce_))
      found = options_.session.empty() || announce_.session == options_.session;
    if (!found) std::this_thread::sleep_for(milliseconds(20));
  }
  if (!found && stop_) return fail("stopped while looking for " + wanted);
  if (!found) {
    return fail("no server announced " + wanted + " on domain " + std::to_string(options_.domain) +
                " within " + std::to_string(options_.patience.count()) + " s: start one with `tenon serve`");
  }
  if (announce_.protocol_version != kProtocolVersion) {
    return fail("the server speaks protocol " + std::to_string(announce_.protocol_version) +
                ", this program " + std::to_string(kProtocolVersion) + ": update the older of the two");
  }
  if (options_.lockstep && !announce_.lockstep) {
    return fail("session '" + announce_.session +
                "' does not run in lockstep: start the server with --lockstep, or leave it out here");
  }
  session_ = std::make_unique<Partition>(*participant, sessionPartition(announce_.session),
                                         announce_.lockstep ? LinkProfile::kLockstep : LinkProfile::kLan);
  return {};
}

Result<void> Recorder::listen() {
  auto recording = Recording::open(options_.file, announce_);
  if (!recording) return fail(recording.error().what);
  recording_ = std::make_unique<Recording>(std::move(*recording));
  auto tap = Tap::open(*session_, topicsInOrder());
  if (!tap) return fail(tap.error().what);
  tap_ = std::make_unique<Tap>(std::move(*tap));

  // a state that arrives proves that the server knows our readers; then wait until it has told them all
  std::size_t heard = 0;
  for (const auto until = Clock::now() + options_.patience; heard == 0 && !stop_ && Clock::now() < until;)
    heard = take(milliseconds(100));
  if (heard == 0) return fail("session '" + announce_.session + "' is announced but silent");
  for (const auto until = Clock::now() + kQuiet; Clock::now() < until;) take(milliseconds(20));
  return {};
}

Result<void> Recorder::ask() {
  auto joins = Writer<Join>::open(*lobby_, kJoin);
  if (!joins) return fail(joins.error().what);
  auto welcomes = Reader<Welcome>::open(*lobby_, kWelcome);
  if (!welcomes) return fail(welcomes.error().what);
  std::random_device source;
  char guid[24];
  std::snprintf(guid, sizeof guid, "%08x%08x", source(), source());
  const Join join{.client_guid = guid, .name = "recorder", .role = Role::kRecorder};
  Welcome welcome;
  auto ask_at = Clock::now();
  for (const auto until = Clock::now() + options_.patience; !stop_ && Clock::now() < until;) {
    if (Clock::now() >= ask_at && joins->matchedReaders() > 0 && welcomes->matchedWriters() > 0) {
      if (auto asked = joins->write(join); !asked) return asked;
      ask_at = Clock::now() + kAskAgain;
    }
    take(milliseconds(5));
    while (welcomes->take(welcome)) {
      if (welcome.client_guid != join.client_guid) continue;
      if (!welcome.accepted)
        return fail("the server of session '" + announce_.session + "' refuses: " + welcome.reason);
      presence_ = {welcome.client, join.name, join.role, {}, true};
      return {};
    }
  }
  if (stop_) return fail("stopped while joining session '" + announce_.session + "'");
  return fail("the server of session '" + announce_.session +
              "' does not answer: it may be hung or just gone");
}

Result<void> Recorder::watch() {
  auto presence = Writer<Presence>::open(*session_, kPresence);
  if (!presence) return fail(presence.error().what);
  presence_writer_ = std::make_unique<Writer<Presence>>(std::move(*presence));
  if (auto told = presence_writer_->write(presence_); !told) return told;
  auto status = Writer<RecorderStatus>::open(*session_, kRecorderStatus);
  if (!status) return fail(status.error().what);
  status_writer_ = std::make_unique<Writer<RecorderStatus>>(std::move(*status));
  Inbox lobby;
  bool server_gone = false;
  const auto watched = lobby.onGone<SessionAnnounce>(
      *lobby_, kSessionAnnounce,
      [&](const SessionAnnounce& gone) { server_gone = server_gone || gone.session == announce_.session; });
  if (!watched) return watched;
  if (options_.say) {
    options_.say("recording session '" + announce_.session + "' into " + options_.file.string());
  }

  auto next_status = Clock::now();
  auto last_heard = Clock::now();
  Clock::time_point over_since{};
  while (!stop_ && recording_->status().problem.empty()) {
    const bool heard = take(milliseconds(50)) > 0;
    lobby.dispatch(milliseconds(0));
    const auto now = Clock::now();
    if (heard) last_heard = now;
    const bool over = recording_->runIsOver() || server_gone;
    if (over && over_since == Clock::time_point{}) over_since = now;
    if (over && (now - last_heard >= kQuiet || now - over_since >= kLongestEnd)) break;
    // our own status is heard as well: after the end it would never be quiet
    if (!over && now >= next_status) {
      static_cast<void>(status_writer_->write(recording_->status()));
      next_status = now + kStatusEvery;
    }
  }
  if (!recording_->status().problem.empty()) {
    static_cast<void>(status_writer_->write(recording_->status()));
    return fail(recording_->status().problem);
  }
  if (server_gone && !recording_->runIsOver()) {
    return fail("the server of session '" + announce_.session +
                "' is gone; what was recorded until then is in " + options_.file.string());
  }
  return {};
}

void Recorder::leave() {
  if (status_writer_) static_cast<void>(status_writer_->write(recording_->status()));
  if (presence_writer_) static_cast<void>(presence_writer_->dispose(presence_));
}

}  // namespace

Result<RecorderStatus> record(const RecorderOptions& options, const std::atomic<bool>& stop) {
  return Recorder(options, stop).run();
}

}  // namespace tenon
