#include "clients/recorder/recorder_program.h"

#include <cstdint>
#include <memory>
#include <set>
#include <utility>

#include "clients/recorder/model_fetch.h"
#include "clients/recorder/recording.h"
#include "idl/types/messages.h"
#include "idl/types/printable_text.h"
#include "idl/wire/codec.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/membership.h"
#include "idl/wire/raw_subscriber.h"

namespace tenon::recorder {

namespace {
using std::chrono::milliseconds;
constexpr milliseconds kQuiet{300};  // at the end of a session, without a sample: nothing more is expected
constexpr milliseconds kMaxDrain{10000};  // after the end of a session, for samples on their way
constexpr milliseconds kStatusPeriod{1000};
// without a sign of life for so long the server has taken this program for dead
constexpr milliseconds kLapse = wire::kPresence.parameters.lease;

/// What a recorder gets for itself. Checkpoints first: within a batch the state that a re-simulation starts
/// from precedes the inputs that follow it.
const std::vector<std::string> kOwnTopics{std::string(wire::kCheckpoint.name),
                                          std::string(wire::kTickInput.name)};

/// What all get. The objects of the scene last: every server has published them before, and DDS announces
/// our readers in the order of their creation, so their arrival proves that the server has matched all
/// readers.
std::vector<std::string> sessionTopics(bool all) {
  std::vector<std::string> topics;
  for (const wire::TopicName& name : wire::allTopics())
    if (name.topic != wire::kCheckpoint.name && name.topic != wire::kTickInput.name &&
        name.topic != wire::kSceneObject.name && !StreamReduction::isCopy(name.topic) &&
        (all || !StreamReduction::isOmitted(name.topic)))
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
                                          .key_file = options_.key_file,
                                          .lockstep = options_.lockstep,
                                          .timeout = options_.timeout,
                                          .recorded_until =
                                              [this](const SessionAnnounce& server) {
                                                return recording_ ? recording_->recordedUntil(server) : 0;
                                              }},
                                         stop_);
    if (!member) return fail(member.error().what);
    member_ = std::move(*member);
    auto done = subscribe();
    if (done) done = member_->join(stop_, [this] { take(milliseconds(1)); });
    if (done) recording_->joined(member_->welcome().tick);
    if (done) done = writeUntilOver();
    const Result<void> closed = recording_ ? recording_->close() : Result<void>{};
    if (status_writer_) tellStatus();
    if (!done) return fail(done.error().what);
    if (!closed) return fail(closed.error().what);
    return RecordingReport{recording_->status(), recording_->counts(), recording_->boxes()};
  }

 private:
  Result<void> subscribe();
  Result<void> writeUntilOver();
  Result<void> comeBack();
  /// Of a file with a long path people are told the begin of it.
  void tellStatus() {
    constexpr std::size_t kMostText = 511;  // [bytes] of RecorderStatus in idl/tenon.idl
    RecorderStatus status = recording_->status();
    status.file = shortened(status.file, kMostText);
    status.problem = shortened(status.problem, kMostText);
    static_cast<void>(status_writer_->write(status));
  }
  /// All that the server published and that can still be expected is recorded.
  [[nodiscard]] bool isComplete() const {
    return recording_->hasStatement() && (!member_->announce().lockstep || recording_->status().lost == 0);
  }
  /// Writes what has arrived within `timeout`; the number of samples.
  std::size_t take(milliseconds timeout) {
    sayWhatIsLost();
    showModels();
    return subscriber_->dispatch(timeout, [this](const wire::RawSample& sample) {
      const auto note = [&]<class M>(const wire::Topic<M>& topic, std::set<std::uint32_t>& known, auto id) {
        if (sample.topic != topic.name || sample.gone) return;
        if (const auto message = wire::decode<M>(sample.bytes)) known.insert(id(*message));
      };
      note(wire::kSceneObject, objects_, [](const SceneObject& object) { return object.object.value; });
      note(wire::kSceneHand, hands_, [](const SceneHand& hand) { return hand.hand.value; });
      note(wire::kSceneStep, steps_, [](const SceneStep& step) { return step.step; });
      recording_->add(sample);
    });
  }
  /// Those that have come.
  void showModels() {
    if (models_ == nullptr) return;
    if (models_->takeArrivals()) recording_->showModels();
    for (const std::string& line : models_->takeLines())
      if (options_.report) options_.report(line);
  }
  /// Of a server that had written more than can be kept before this program belonged to it.
  void sayWhatIsLost() {
    const std::uint64_t lost = subscriber_->lost();
    if (lost == std::exchange(lost_, lost)) return;
    recording_->lostBefore(lost);
    if (options_.report)
      options_.report(std::to_string(lost) +
                      " samples that the server sent before this program had joined are not recorded");
  }
  /// As many samples of the scene are recorded as the server announces; one at least.
  [[nodiscard]] bool hasScene() const {
    const SessionAnnounce& whole = member_->announce();
    return !objects_.empty() && objects_.size() >= whole.objects && hands_.size() >= whole.hands &&
           steps_.size() >= whole.steps;
  }

  const RecorderOptions& options_;
  const std::atomic<bool>& stop_;
  std::unique_ptr<wire::Membership> member_;
  std::unique_ptr<Recording> recording_;
  std::unique_ptr<ModelFetch> models_;  ///< none: they are looked for on this machine alone
  std::unique_ptr<wire::RawSubscriber> subscriber_;
  std::unique_ptr<wire::Writer<RecorderStatus>> status_writer_;
  std::uint64_t lost_ = 0;                           ///< that is said
  std::set<std::uint32_t> objects_, hands_, steps_;  ///< of the scene, recorded
};

Result<void> Recorder::subscribe() {
  auto recording =
      Recording::open(options_.file, member_->announce(), options_.all ? Streams::kAll : Streams::kReduced,
                      wire::AssetStore(options_.assets));
  if (!recording) return fail(recording.error().what);
  recording_ = std::make_unique<Recording>(std::move(*recording));
  if (!options_.assets_url.empty())
    models_ = std::make_unique<ModelFetch>(wire::AssetStore(options_.assets), member_->announce().scene_hash,
                                           options_.assets_url);
  auto subscriber = wire::RawSubscriber::open(member_->own(), kOwnTopics);
  if (!subscriber) return fail(subscriber.error().what);
  if (auto added = subscriber->add(member_->everything(), sessionTopics(options_.all)); !added) return added;
  subscriber_ = std::make_unique<wire::RawSubscriber>(std::move(*subscriber));

  // the whole scene proves that the server has matched our readers; what else it keeps for late joiners
  // may come later, and is recorded then
  for (const auto until = std::chrono::steady_clock::now() + options_.timeout;
       !hasScene() && !stop_ && std::chrono::steady_clock::now() < until;)
    take(milliseconds(20));
  if (!hasScene())
    return fail("session '" + member_->sessionName() + "' is announced but does not send all of its scene");
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
  auto last_pass = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point over_since{};
  while (!stop_ && recording_->problem().empty()) {
    const bool received = take(milliseconds(50)) > 0;
    lobby.dispatch(milliseconds(0));
    const auto now = std::chrono::steady_clock::now();
    const bool lapsed = now - std::exchange(last_pass, now) > kLapse;
    if (received) last_sample = now;
    if ((member_->lost() || lapsed) && !recording_->runIsOver()) {
      if (auto back = comeBack(); !back) return back;
      last_sample = last_pass = std::chrono::steady_clock::now();
      continue;
    }
    const bool over = recording_->runIsOver() || member_->serverIsGone();
    if (over && over_since == std::chrono::steady_clock::time_point{}) over_since = now;
    const bool quiet = now - last_sample >= kQuiet;
    if (over && ((quiet && (isComplete() || member_->serverIsGone())) || now - over_since >= kMaxDrain))
      break;
    // our own status is recorded as well, so it must not be sent while the end is awaited
    if (!over && now >= next_status) {
      tellStatus();
      next_status = now + kStatusPeriod;
    }
  }
  if (!recording_->problem().empty()) {
    tellStatus();
    return fail(recording_->problem());
  }
  return {};
}

/// The server is gone: continues in the same file when another one resumes the session, or when one of the
/// two programs stood still and was taken for dead.
Result<void> Recorder::comeBack() {
  const std::uint32_t epoch = member_->announce().server_epoch;
  const std::string why = member_->lost().value_or("this program stood still");
  if (options_.report)
    options_.report(why + (member_->serverIsGone() ? "; waiting for one that resumes the session"
                                                   : "; joining the session again"));
  const auto until_then = "; the recording up to then is in " + options_.file.string();
  // what the next server sends is delivered by the first dispatch after resumed()
  while (!stop_ && take(milliseconds(0)) > 0) {
  }
  if (auto back = member_->rejoin(stop_); !back) return fail(why + "; " + back.error().what + until_then);
  if (member_->announce().server_epoch == epoch)
    return {};  // what was missed meanwhile is counted as missing
  const std::string after = "after tick " + std::to_string(member_->announce().resumed_after);
  if (!recording_->continues(member_->announce()))
    return fail(why + ", and the next one begins " + after + ", not where the recording ends" + until_then);
  recording_->resumed(member_->announce());
  if (options_.report) options_.report("recording the resumed session " + after);
  return {};
}

}  // namespace

std::uint64_t RecordingReport::missingTicks() const {
  for (const TopicCount& count : counts)
    if (count.topic == wire::kTickInput.name) return count.published - count.recorded;
  return 0;
}

Result<RecordingReport> recordSession(const RecorderOptions& options, const std::atomic<bool>& stop) {
  return Recorder(options, stop).run();
}

}  // namespace tenon::recorder
