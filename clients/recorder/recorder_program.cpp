#include "clients/recorder/recorder_program.h"

#include <memory>
#include <utility>

#include "clients/recorder/recording.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/membership.h"
#include "idl/wire/tap.h"

namespace tenon {

namespace {
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;
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
    auto member = Membership::find({.session = options_.session,
                                    .domain = options_.domain,
                                    .person = "recorder",
                                    .role = Role::kRecorder,
                                    .lockstep = options_.lockstep,
                                    .patience = options_.patience},
                                   stop_);
    if (!member) return fail(member.error().what);
    member_ = std::move(*member);
    auto done = listen();
    if (done) done = member_->join(stop_, [this] { take(milliseconds(1)); });
    if (done) done = watch();
    const Result<void> closed = recording_ ? recording_->close() : Result<void>{};
    if (status_writer_) static_cast<void>(status_writer_->write(recording_->status()));
    if (!done) return fail(done.error().what);
    if (!closed) return fail(closed.error().what);
    return recording_->status();
  }

 private:
  Result<void> listen();
  Result<void> watch();
  std::size_t take(milliseconds timeout) {
    return tap_->dispatch(timeout, [this](const RawSample& sample) { recording_->add(sample); });
  }

  const RecorderOptions& options_;
  const std::atomic<bool>& stop_;
  std::unique_ptr<Membership> member_;
  std::unique_ptr<Recording> recording_;
  std::unique_ptr<Tap> tap_;
  std::unique_ptr<Writer<RecorderStatus>> status_writer_;
};

Result<void> Recorder::listen() {
  auto recording = Recording::open(options_.file, member_->announce());
  if (!recording) return fail(recording.error().what);
  recording_ = std::make_unique<Recording>(std::move(*recording));
  auto tap = Tap::open(member_->session(), topicsInOrder());
  if (!tap) return fail(tap.error().what);
  tap_ = std::make_unique<Tap>(std::move(*tap));

  // a state that arrives proves that the server knows our readers; then wait until it has told them all
  std::size_t heard = 0;
  for (const auto until = Clock::now() + options_.patience; heard == 0 && !stop_ && Clock::now() < until;)
    heard = take(milliseconds(100));
  if (heard == 0) return fail("session '" + member_->sessionName() + "' is announced but silent");
  for (const auto until = Clock::now() + kQuiet; Clock::now() < until;) take(milliseconds(20));
  return {};
}

Result<void> Recorder::watch() {
  auto status = Writer<RecorderStatus>::open(member_->session(), kRecorderStatus);
  if (!status) return fail(status.error().what);
  status_writer_ = std::make_unique<Writer<RecorderStatus>>(std::move(*status));
  Inbox lobby;
  if (auto watched = member_->watch(lobby); !watched) return watched;
  if (options_.say) {
    options_.say("recording session '" + member_->sessionName() + "' into " + options_.file.string());
  }

  auto next_status = Clock::now();
  auto last_heard = Clock::now();
  Clock::time_point over_since{};
  while (!stop_ && recording_->status().problem.empty()) {
    const bool heard = take(milliseconds(50)) > 0;
    lobby.dispatch(milliseconds(0));
    const auto now = Clock::now();
    if (heard) last_heard = now;
    const bool over = recording_->runIsOver() || member_->serverIsGone();
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
  if (member_->serverIsGone() && !recording_->runIsOver())
    return fail(*member_->lost() + "; what was recorded until then is in " + options_.file.string());
  return {};
}

}  // namespace

Result<RecorderStatus> record(const RecorderOptions& options, const std::atomic<bool>& stop) {
  return Recorder(options, stop).run();
}

}  // namespace tenon
