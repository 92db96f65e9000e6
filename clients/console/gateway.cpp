#include "clients/console/gateway.h"

#include <chrono>
#include <thread>

#include "clients/console/session_channels.h"
#include "idl/wire/membership.h"
#include "idl/wire/raw_subscriber.h"

namespace tenon::console {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

namespace {

constexpr milliseconds kCollect{10};  // messages of this time go to viewers together
constexpr milliseconds kPause{1000};  // before a session is looked for again
constexpr std::chrono::seconds kSearch{5};

std::int64_t nowNanoseconds() {
  return std::chrono::system_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

class Gateway {
 public:
  Gateway(const GatewayOptions& options, const std::atomic<bool>& stop)
      : options_(options), stop_(stop), channels_(wire::AssetStore(options.cache / "assets")) {}

  Result<void> run() {
    Site site(options_.page, wire::AssetStore(options_.cache / "assets"));
    const bool has_page = site.hasPage();
    auto opened = WebServer::open(options_.web, std::move(site), channels_.channels());
    if (!opened) return fail(opened.error().what);
    server_ = std::move(*opened);
    server_->start();
    options_.print("console: http://localhost:" + std::to_string(server_->port()) + "/");
    if (!has_page)
      options_.print(
          "the console's page is not built, so this address serves public viewers only: "
          "`deploy/setup console` installs what builds it");
    auto participant = wire::Participant::open({.domain = options_.domain, .config = {}});
    if (!participant) return fail(participant.error().what);
    setState(LinkState::kSearching, {});
    while (!stop_) {
      serveOneSession();
      for (auto waited = milliseconds(0); waited < kPause && !stop_; waited += kCollect)
        std::this_thread::sleep_for(kCollect);
    }
    return {};
  }

 private:
  void setState(LinkState state, const std::string& reason) {
    const bool is_new = state != state_ || reason != reason_;
    state_ = state;
    reason_ = reason;
    channels_.setState(state, reason, nowNanoseconds());
    server_->publish(channels_.take());
    if (is_new && !reason.empty()) options_.print(reason);
  }
  void serveOneSession();
  void forward(wire::Membership& member, wire::RawSubscriber& subscriber, wire::Inbox& inbox);

  const GatewayOptions& options_;
  const std::atomic<bool>& stop_;
  SessionChannels channels_;
  std::unique_ptr<WebServer> server_;
  LinkState state_ = LinkState::kSearching;
  std::string reason_;
};

void Gateway::serveOneSession() {
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
  auto subscriber = wire::RawSubscriber::open(member.session(), SessionChannels::topics());
  if (!subscriber) return setState(LinkState::kRefused, subscriber.error().what);
  if (auto joined = member.join(stop_); !joined) {
    if (!stop_) setState(LinkState::kRefused, joined.error().what);
    return;
  }
  channels_.begin(member.announce(), nowNanoseconds());
  setState(LinkState::kJoined, "joined session '" + member.sessionName() + "'");
  forward(member, *subscriber, inbox);
}

void Gateway::forward(wire::Membership& member, wire::RawSubscriber& subscriber, wire::Inbox& inbox) {
  const auto receive = [this](const wire::RawSample& sample) { channels_.receive(sample); };
  while (!stop_ && !member.serverIsGone() && !member.lost()) {
    subscriber.dispatch(kCollect, receive);
    inbox.dispatch(milliseconds(0));
    server_->publish(channels_.take());
  }
  if (stop_) return;
  subscriber.dispatch(milliseconds(0), receive);  // its last words
  server_->publish(channels_.take());
  if (channels_.isOver())
    return setState(LinkState::kEnded, "session '" + member.sessionName() + "' has ended");
  setState(LinkState::kLost, member.lost().value_or("session '" + member.sessionName() + "' is gone"));
}

}  // namespace

Result<void> runGateway(const GatewayOptions& options, const std::atomic<bool>& stop) {
  return Gateway(options, stop).run();
}

fs::path defaultPage() {
  std::error_code error;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  for (const char* beside : {"../console_page", "../../share/tenon/console_page"})
    if (fs::exists(folder / beside / "index.html", error)) return (folder / beside).lexically_normal();
  return (folder / "../console_page").lexically_normal();
}

}  // namespace tenon::console
