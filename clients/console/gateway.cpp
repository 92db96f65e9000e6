#include "clients/console/gateway.h"

#include <chrono>
#include <map>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include <nlohmann/json.hpp>

#include "clients/console/browser_hands.h"
#include "clients/console/desk.h"
#include "clients/console/lobby.h"
#include "clients/console/session_feed.h"
#include "idl/types/names.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/participant.h"

namespace tenon::console {

namespace fs = std::filesystem;

namespace {

constexpr std::chrono::milliseconds kPeriod{20};
constexpr std::size_t kMaxSessions = 64;  // that are offered

std::int64_t nowNanoseconds() {
  return std::chrono::system_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

class Gateway {
 public:
  Gateway(const GatewayOptions& options, const std::atomic<bool>& stop)
      : options_(options),
        stop_(stop),
        pass_(options.role && options.recording.empty() ? makePass() : ""),
        rights_{.domain = options.domain, .role = options.role, .pass = pass_, .key_file = options.key_file},
        desk_(rights_, [this](ViewerId viewer, const DeskAnswer& answer) { say(viewer, answer); }),
        hands_(
            rights_, [this](ViewerId viewer, const DeskAnswer& answer) { say(viewer, answer); },
            [this](ViewerId viewer, Payload views) { server_->show(viewer, std::move(views)); },
            options.print) {}

  ~Gateway() {
    if (server_ != nullptr) server_->stop();
  }
  Gateway(const Gateway&) = delete;
  Gateway& operator=(const Gateway&) = delete;

  Result<void> run() {
    if (auto opened = openServer(); !opened) return opened;
    if (options_.recording.empty()) return followSessions();
    while (!stop_) std::this_thread::sleep_for(kPeriod);
    return {};
  }

 private:
  Result<void> openServer();
  Result<void> followSessions();
  void enter(const std::string& room);
  void offerFeed(const std::string& room, const std::string& session);
  void startFeeds();
  [[nodiscard]] std::string sessionOf(const std::string& room);
  void say(ViewerId viewer, const DeskAnswer& answer) { server_->answer(viewer, deskAnswerText(answer)); }

  const GatewayOptions& options_;
  const std::atomic<bool>& stop_;
  std::string pass_;
  std::mutex mutex_;
  std::set<std::string> entered_;      ///< rooms with viewers whose feeds are to be started
  std::unique_ptr<WebServer> server_;  // after feeds, desk and hands, which publish and answer through it
  std::map<std::string, std::unique_ptr<SessionFeed>> feeds_;  ///< by room
  SeatRights rights_;
  Desk desk_;
  BrowserHands hands_;
};

Result<void> Gateway::openServer() {
  const wire::AssetStore assets(options_.cache / "assets");
  Site site(options_.page, assets);
  const bool has_page = site.hasPage();
  const nlohmann::json described{{"session", options_.session},
                                 {"recording", options_.recording.filename().string()},
                                 {"role", options_.role ? roleName(*options_.role) : ""},
                                 {"protocol", kProtocolVersion}};
  site.describe(described.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  if (!options_.recording.empty())
    if (auto served = site.serveRecording(options_.recording); !served) return served;
  const auto handle = [this](ViewerId viewer, const std::string& room, const DeskRequest& request) {
    if (request.isOfHands()) return hands_.handle(viewer, sessionOf(room), request);
    desk_.handle(viewer, sessionOf(room), request);
  };
  const auto leave = [this](ViewerId viewer) {
    desk_.left(viewer);
    hands_.left(viewer);
  };
  auto opened = WebServer::open(options_.web, std::move(site),
                                {[this](const std::string& room) { enter(room); }, leave, handle,
                                 [this](ViewerId viewer, std::span<const std::uint8_t> targets) {
                                   return hands_.move(viewer, targets);
                                 }});
  if (!opened) return fail(opened.error().what);
  server_ = std::move(*opened);
  server_->addRoom(std::string(kLobbyRoom), Lobby::channels());
  if (options_.recording.empty()) offerFeed(std::string(kFirstRoom), options_.session);
  server_->start();
  const std::string address = "http://localhost:" + std::to_string(server_->port()) + "/";
  options_.print("console: " + address);
  if (!pass_.empty())
    options_.print("the same as " + std::string(roleName(*options_.role)) + ", for you alone: " + address +
                   "#pass=" + pass_);
  if (!has_page)
    options_.print(
        "the console's page is not built, so this address serves public viewers only: "
        "`deploy/setup console` installs what builds it");
  return {};
}

Result<void> Gateway::followSessions() {
  auto participant = wire::Participant::open({.domain = options_.domain, .config = {}});
  if (!participant) return fail(participant.error().what);
  if (!options_.session.empty()) enter(std::string(kFirstRoom));
  wire::Partition partition(*participant, wire::kLobby);
  Lobby lobby;
  wire::Inbox inbox;
  auto watched = inbox.on<SessionAnnounce>(partition, wire::kSessionAnnounce,
                                           [&](const SessionAnnounce& announce) { lobby.add(announce); });
  if (watched)
    watched = inbox.onGone<SessionAnnounce>(partition, wire::kSessionAnnounce,
                                            [&](const SessionAnnounce& gone) { lobby.remove(gone); });
  if (!watched) return watched;
  while (!stop_) {
    inbox.dispatch(kPeriod);
    for (const std::string& name : lobby.names())
      if (options_.session.empty()) offerFeed(std::string(kFirstRoom) + "/" + name, name);
    server_->publish(std::string(kLobbyRoom), lobby.take(nowNanoseconds()));
    startFeeds();
  }
  return {};
}

void Gateway::offerFeed(const std::string& room, const std::string& session) {
  const std::scoped_lock lock(mutex_);
  if (feeds_.contains(room) || feeds_.size() >= kMaxSessions) return;
  feeds_.emplace(room, std::make_unique<SessionFeed>(FeedOptions{.room = room,
                                                                 .session = session,
                                                                 .domain = options_.domain,
                                                                 .assets = options_.cache / "assets",
                                                                 .print = options_.print},
                                                     *server_));
}

void Gateway::enter(const std::string& room) {
  const std::scoped_lock lock(mutex_);
  entered_.insert(room);
}

/// Those of rooms that somebody has entered.
void Gateway::startFeeds() {
  const std::scoped_lock lock(mutex_);
  for (const std::string& room : std::exchange(entered_, {})) {
    const auto feed = feeds_.find(room);
    if (feed == feeds_.end()) continue;
    feed->second->start();
    if (const std::string session = feed->second->sessionName(); !session.empty()) desk_.expect(session);
  }
}

std::string Gateway::sessionOf(const std::string& room) {
  const std::scoped_lock lock(mutex_);
  const auto feed = feeds_.find(room);
  return feed == feeds_.end() ? "" : feed->second->sessionName();
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
