#include "clients/console/session_feed.h"

#include <chrono>
#include <utility>

#include "idl/wire/membership.h"
#include "idl/wire/raw_subscriber.h"

namespace tenon::console {

namespace {

using std::chrono::milliseconds;
constexpr milliseconds kCollect{10};  // messages of this time go to viewers together
constexpr milliseconds kPause{1000};  // before a session is looked for again
constexpr std::chrono::seconds kSearch{5};

std::int64_t nowNanoseconds() {
  return std::chrono::system_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

}  // namespace

SessionFeed::SessionFeed(FeedOptions options, WebServer& server)
    : options_(std::move(options)), server_(server), channels_(wire::AssetStore(options_.assets)) {
  server_.addRoom(options_.room, channels_.channels());
}

SessionFeed::~SessionFeed() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

void SessionFeed::start() {
  if (!thread_.joinable()) thread_ = std::thread([this] { run(); });
}

std::string SessionFeed::sessionName() const {
  const std::scoped_lock lock(mutex_);
  return session_name_.empty() ? options_.session : session_name_;
}

void SessionFeed::run() {
  setState(LinkState::kSearching, {});
  while (!stop_) {
    serveOneSession();
    for (auto waited = milliseconds(0); waited < kPause && !stop_; waited += kCollect)
      std::this_thread::sleep_for(kCollect);
  }
}

void SessionFeed::setState(LinkState state, const std::string& reason) {
  const bool is_new = state != state_ || reason != reason_;
  state_ = state;
  reason_ = reason;
  is_recorded_told_ = is_recorded_;
  channels_.setState(state, reason, is_recorded_told_, nowNanoseconds());
  server_.publish(options_.room, channels_.take());
  if (is_new && !reason.empty()) options_.print(reason);
}

void SessionFeed::serveOneSession() {
  auto found = wire::Membership::find({.session = options_.session,
                                       .domain = options_.domain,
                                       .person = "console",
                                       .role = Role::kObserver,
                                       .passive = true,
                                       .timeout = kSearch},
                                      stop_);
  if (!found) {
    // what was seen last stays on the screen, with what happened to it
    if (state_ == LinkState::kSearching && !stop_) setState(LinkState::kSearching, found.error().what);
    return;
  }
  wire::Membership& member = **found;
  wire::Inbox inbox;
  if (auto watched = member.watch(inbox); !watched)
    return setState(LinkState::kRefused, watched.error().what);
  auto subscriber = wire::RawSubscriber::open(member.everything(), SessionChannels::topics());
  if (!subscriber) return setState(LinkState::kRefused, subscriber.error().what);
  if (auto joined = member.join(stop_); !joined) {
    if (!stop_) setState(LinkState::kRefused, joined.error().what);
    return;
  }
  {
    const std::scoped_lock lock(mutex_);
    session_name_ = member.sessionName();
  }
  channels_.begin(member.announce(), nowNanoseconds());
  setState(LinkState::kJoined, "joined session '" + member.sessionName() + "'");
  forward(member, *subscriber, inbox);
}

void SessionFeed::forward(wire::Membership& member, wire::RawSubscriber& subscriber, wire::Inbox& inbox) {
  const auto receive = [this](const wire::RawSample& sample) { channels_.receive(sample); };
  while (!stop_ && !member.serverIsGone() && !member.lost()) {
    subscriber.dispatch(kCollect, receive);
    inbox.dispatch(milliseconds(0));
    server_.publish(options_.room, channels_.take());
    if (is_recorded_ != is_recorded_told_) setState(state_, reason_);
  }
  if (stop_) return;
  subscriber.dispatch(milliseconds(0), receive);  // samples that arrived before the end
  server_.publish(options_.room, channels_.take());
  if (channels_.isOver())
    return setState(LinkState::kEnded, "session '" + member.sessionName() + "' has ended");
  setState(LinkState::kLost, member.lost().value_or("session '" + member.sessionName() + "' is gone"));
}

}  // namespace tenon::console
