#include "clients/recorder/recorder_program.h"

#include <memory>
#include <utility>

#include "clients/recorder/recording.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/membership.h"
#include "idl/wire/raw_subscriber.h"

namespace tenon::recorder {

namespace {
using std::chrono::milliseconds;
constexpr milliseconds kQuiet{300};       // without a sample: nothing more is expected
constexpr milliseconds kMaxDrain{10000};  // after the end of a session, for samples on their way
constexpr milliseconds kStatusPeriod{1000};

/// Checkpoints first: within a batch the state that a re-simulation starts from precedes the inputs that
/// follow it. The objects of the scene last: every server has published them before, and DDS announces our
/// readers in the order of their creation, so their arrival proves that the server has matched all readers.
std::vector<std::string> topicsInOrder() {
  std::vector<std::string> topics{std::string(wire::kCheckpoint.name)};
  for (const wire::TopicName& name : wire::allTopics())
    if (name.topic != wire::kCheckpoint.name && name.topic != wire::kSceneObject.name)
      topics.emplace_back(name.topic);
  topics.emplace_back(wire::kSceneObject.name);
  return topics;
}

class Recorder {
 public:
  Recorder(const RecorderOptions& options, const std::atomic<bool>& stop) : options_(options), stop_(stop) {}

  Result<RecordingReport> run() {
    auto member = wire::Membership::find({.session = options_.session,
                                          .domain = options_.domain,
                                          .person = "recorder",
                                          .role = Role::kRecorder,
                                          .lockstep = options_.lockstep,
                                          .timeout = options_.timeout},
                                         stop_);
    if (!member) return fail(member.error().what);
    member_ = std::move(*member);
    auto done = subscribe();
    if (done) done = member_->join(stop_, [this] { take(milliseconds(1)); });
    if (done) recording_->joined(member_->welcome().tick);
    if (done) done = writeUntilOver();
    const Result<void> closed = recording_ ? recording_->close() : Result<void>{};
    if (status_writer_) static_cast<void>(status_writer_->write(recording_->status()));
    if (!done) return fail(done.error().what);
    if (!closed) return fail(closed.error().what);
    return RecordingReport{recording_->status(), recording_->counts()};
  }

 private:
  Result<void> subscribe();
  Result<void> writeUntilOver();
  Result<void> comeBack();
  /// All that the server published and that can still be expected is recorded.
  [[nodiscard]] bool isComplete() const {
    return recording_->hasStatement() && (!member_->announce().lockstep || recording_->status().lost == 0);
  }
  /// Writes what has arrived within `timeout`; the number of samples.
  std::size_t take(milliseconds timeout) {
    return subscriber_->dispatch(timeout, [this](const wire::RawSample& sample) {
      has_scene_ = has_scene_ || sample.topic == wire::kSceneObject.name;
      recording_->add(sample);
    });
  }

  const RecorderOptions& options_;
  const std::atomic<bool>& stop_;
  std::unique_ptr<wire::Membership> member_;
  std::unique_ptr<Recording> recording_;
  std::unique_ptr<wire::RawSubscriber> subscriber_;
  std::unique_ptr<wire::Writer<RecorderStatus>> status_writer_;
  bool has_scene_ = false;
};

Result<void> Recorder::subscribe() {
  auto recording = Recording::open(options_.file, member_->announce());
  if (!recording) return fail(recording.error().what);
  recording_ = std::make_unique<Recording>(std::move(*recording));
  auto subscriber = wire::RawSubscriber::open(member_->session(), topicsInOrder());
  if (!subscriber) return fail(subscriber.error().what);
  subscriber_ = std::make_unique<wire::RawSubscriber>(std::move(*subscriber));

  // the scene proves that the server has matched our readers; then wait until all transient-local states came
  for (const auto until = std::chrono::steady_clock::now() + options_.timeout;
       !has_scene_ && !stop_ && std::chrono::steady_clock::now() < until;)
    take(milliseconds(100));
  if (!has_scene_)
    return fail("session '" + member_->sessionName() + "' is announced but sends no objects of its scene");
  for (const auto until = std::chrono::steady_clock::now() + kQuiet;
       std::chrono::steady_clock::now() < until;)
    take(milliseconds(20));
  return {};
}

Result<void> Recorder::writeUntilOver() {
  if (auto opened = openInto(status_writer_, member_->session(), wire::kRecorderStatus); !opened)
    return opened;
  wire::Inbox lobby;
  if (auto watched = member_->watch(lobby); !watched) return watched;
  if (options_.report) {
    options_.report("recording session '" + member_->sessionName() + "' into " + options_.file.string());
  }

  auto next_status = std::chrono::steady_clock::now();
  auto last_sample = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point over_since{};
  while (!stop_ && recording_->problem().empty()) {
    const bool received = take(milliseconds(50)) > 0;
    lobby.dispatch(milliseconds(0));
    const auto now = std::chrono::steady_clock::now();
    if (received) last_sample = now;
    if (member_->serverIsGone() && !recording_->runIsOver()) {
      if (auto back = comeBack(); !back) return back;
      last_sample = std::chrono::steady_clock::now();
      continue;
    }
    const bool over = recording_->runIsOver() || member_->serverIsGone();
    if (over && over_since == std::chrono::steady_clock::time_point{}) over_since = now;
    const bool quiet = now - last_sample >= kQuiet;
    if (over && ((quiet && (isComplete() || member_->serverIsGone())) || now - over_since >= kMaxDrain))
      break;
    // our own status is recorded as well, so it must not be sent while the end is awaited
    if (!over && now >= next_status) {
      static_cast<void>(status_writer_->write(recording_->status()));
      next_status = now + kStatusPeriod;
    }
  }
  if (!recording_->problem().empty()) {
    static_cast<void>(status_writer_->write(recording_->status()));
    return fail(recording_->problem());
  }
  return {};
}

/// The server is gone: continues in the same file when another one resumes the session, or when it was taken
/// for dead while one of the two programs stood still.
Result<void> Recorder::comeBack() {
  const std::uint32_t epoch = member_->announce().server_epoch;
  const std::string why = *member_->lost();
  if (options_.report) options_.report(why + "; waiting for one that resumes the session");
  const auto until_then = "; the recording up to then is in " + options_.file.string();
  // what the next server sends is delivered by the first dispatch after resumed()
  while (!stop_ && take(milliseconds(0)) > 0) {
  }
  if (auto back = member_->rejoin(stop_); !back) return fail(why + "; " + back.error().what + until_then);
  if (member_->announce().server_epoch == epoch)
    return {};  // what was missed meanwhile is counted as missing
  if (!recording_->continues(member_->announce(), member_->welcome().tick))
    return fail(why + ", and the next one begins after tick " + std::to_string(member_->welcome().tick) +
                ", not where the recording ends" + until_then);
  recording_->resumed(member_->announce(), member_->welcome().tick);
  if (options_.report)
    options_.report("recording the resumed session after tick " + std::to_string(member_->welcome().tick));
  return {};
}

}  // namespace

Result<RecordingReport> recordSession(const RecorderOptions& options, const std::atomic<bool>& stop) {
  return Recorder(options, stop).run();
}

}  // namespace tenon::recorder
