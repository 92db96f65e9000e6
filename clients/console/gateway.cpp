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
#include "idl/record/recording_kind.h"
#include "idl/types/names.h"
#include "idl/types/printable_text.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/identity.h"
#include "idl/wire/participant.h"

namespace tenon::console {

namespace fs = std::filesystem;

namespace {

constexpr std::chrono::milliseconds kPeriod{20};
constexpr std::chrono::hours kSoon{24 * 14};  // a certificate expires
constexpr std::size_t kMaxSessions = 64;      // that are shown

std::int64_t nowNanoseconds() {
  return std::chrono::system_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

std::string roomOfSession(const std::string& name) { return std::string(kFirstRoom) + "/" + name; }

class Gateway {
 public:
  Gateway(const GatewayOptions& options, const std::atomic<bool>& stop)
      : options_(options),
        stop_(stop),
        pass_(options.role && options.recording.empty() ? wire::randomHex() : ""),
        rights_{.domain = options.domain,
                .role = options.role,
                .pass = pass_,
                .key_file = options.key_file,
                .is_local = isLoopbackAddress(options.web.address)},
        desk_(rights_, options.recordings, options.cache / "assets",
              [this](ViewerId viewer, const DeskAnswer& answer) { say(viewer, answer); }),
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
    if (!options_.recording.empty()) {
      if (auto checked = checkRecording(); !checked || stop_) return checked;
    }
    if (auto opened = openServer(); !opened) return opened;
    if (options_.recording.empty()) return followSessions();
    while (!stop_) std::this_thread::sleep_for(kPeriod);
    return {};
  }

 private:
  Result<void> checkRecording();
  Result<void> openServer();
  Result<void> followSessions();
  void enter(const std::string& room);
  void leave(const std::string& room);
  void offerFeeds(Lobby& lobby);
  void endFeeds(const std::set<std::string>& rooms);
  bool offerFeed(const std::string& room, const std::string& session);
  void startFeeds();
  void tellRecorded();
  [[nodiscard]] std::set<std::string> expectedSessions();
  [[nodiscard]] std::string sessionOf(const std::string& room);
  void say(ViewerId viewer, const DeskAnswer& answer) { server_->answer(viewer, answer); }

  const GatewayOptions& options_;
  const std::atomic<bool>& stop_;
  std::string pass_;
  std::mutex mutex_;
  std::set<std::string> entered_;               ///< rooms with viewers whose feeds are to be started
  std::set<std::string> started_;               ///< rooms that somebody has entered
  std::map<std::string, std::size_t> viewers_;  ///< by room; those of rooms that have any
  std::unique_ptr<WebServer> server_;           ///< destroyed after feeds, desk and hands, which use it
  std::map<std::string, std::unique_ptr<SessionFeed>> feeds_;  ///< by room
  SeatRights rights_;
  Desk desk_;
  BrowserHands hands_;
};

/// Before it is served: some seconds for 100 MB.
Result<void> Gateway::checkRecording() {
  auto told = std::chrono::steady_clock::now();
  const auto playable = record::checkPlayable(options_.recording, stop_, [&](double fraction) {
    const auto now = std::chrono::steady_clock::now();
    if (!options_.progress || now - told < options_.progress_period) return;
    told = now;
    options_.progress(options_.recording.string() + ": checking that it is whole, " +
                      std::to_string(static_cast<int>(100.0 * fraction)) + " %");
  });
  if (!playable) return fail(playable.error().what);
  if (!playable->empty()) options_.print("warning: " + *playable);
  return {};
}

Result<void> Gateway::openServer() {
  const wire::AssetStore assets(options_.cache / "assets");
  Site site(options_.page, assets);
  const bool has_page = site.hasPage();
  const nlohmann::json described{{"session", options_.session},
                                 {"recording", options_.recording.filename().string()},
                                 {"recordings", !options_.recordings.empty()},
                                 {"role", options_.role ? roleName(*options_.role) : ""},
                                 {"local", rights_.is_local},
                                 {"protocol", kProtocolVersion}};
  site.describe(described.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  if (!options_.recording.empty())
    if (auto served = site.serveRecording(options_.recording); !served) return served;
  const auto handle = [this](ViewerId viewer, const std::string& room, const DeskRequest& request) {
    if (request.isOfHands()) return hands_.handle(viewer, sessionOf(room), request);
    desk_.handle(viewer, sessionOf(room), request);
  };
  auto opened = WebServer::open(options_.web, std::move(site),
                                {[this](const std::string& room) { enter(room); },
                                 [this](ViewerId viewer, const std::string& room) {
                                   desk_.left(viewer);
                                   hands_.left(viewer);
                                   leave(room);
                                 },
                                 handle,
                                 [this](ViewerId viewer, std::span<const std::uint8_t> targets) {
                                   return hands_.move(viewer, targets);
                                 },
                                 [this](const std::string& room, const std::string& text) {
                                   options_.print(printable(room) + ": " + text);
                                 }});
  if (!opened) return fail(opened.error().what);
  server_ = std::move(*opened);
  server_->addRoom(std::string(kLobbyRoom), Lobby::channels());
  if (options_.recording.empty()) static_cast<void>(offerFeed(std::string(kFirstRoom), options_.session));
  server_->start();
  const std::string address = server_->address();
  options_.print("console: " + address);
  if (!pass_.empty())
    options_.print("the same as " + std::string(roleName(*options_.role)) + ", for you alone: " + address +
                   "#pass=" + pass_);
  if (const auto validity = server_->certificateValidity(); validity && *validity < kSoon)
    options_.print("the certificate expires in " + std::to_string(validity->count() / 24) +
                   " days: `tenon cert` makes a new one");
  if (!has_page)
    options_.print(
        "the console's page is not built, so this address serves public viewers only: "
        "`deploy/setup console` installs what builds it");
  return {};
}

Result<void> Gateway::followSessions() {
  auto participant = wire::Participant::open({.domain = options_.domain, .config = {}});
  if (!participant) return fail(participant.error().what);
  if (!options_.session.empty()) entered_.insert(std::string(kFirstRoom));
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
    if (options_.session.empty()) offerFeeds(lobby);
    server_->publish(std::string(kLobbyRoom), lobby.take(nowNanoseconds()));
    startFeeds();
    desk_.expect(expectedSessions());
    tellRecorded();
  }
  return {};
}

/// Of the sessions of the lobby, as many as are permitted. Feeds of ended sessions without viewers are closed
/// first.
void Gateway::offerFeeds(Lobby& lobby) {
  std::set<std::string> rooms{std::string(kFirstRoom)}, unserved;
  for (const std::string& name : lobby.names()) rooms.insert(roomOfSession(name));
  endFeeds(rooms);
  for (const std::string& name : lobby.names())
    if (!offerFeed(roomOfSession(name), name)) unserved.insert(name);
  for (const std::string& name : lobby.setUnserved(unserved))
    options_.print("session '" + printable(name) + "' is not shown: this gateway shows " +
                   std::to_string(kMaxSessions) + " sessions at most");
}

void Gateway::endFeeds(const std::set<std::string>& rooms) {
  std::vector<std::unique_ptr<SessionFeed>> ended;  // their threads end without the lock
  const std::scoped_lock lock(mutex_);
  for (auto known = feeds_.begin(); known != feeds_.end();) {
    const auto current = known++;
    const std::string& room = current->first;
    if (rooms.contains(room) || viewers_.contains(room)) continue;
    server_->removeRoom(room);
    started_.erase(room);
    ended.push_back(std::move(current->second));
    feeds_.erase(current);
  }
}

/// False when there are too many.
bool Gateway::offerFeed(const std::string& room, const std::string& session) {
  const std::scoped_lock lock(mutex_);
  if (feeds_.contains(room)) return true;
  if (feeds_.size() > kMaxSessions) return false;  // with that of kFirstRoom
  feeds_.emplace(room, std::make_unique<SessionFeed>(FeedOptions{.room = room,
                                                                 .session = session,
                                                                 .domain = options_.domain,
                                                                 .assets = options_.cache / "assets",
                                                                 .print = options_.print},
                                                     *server_));
  return true;
}

void Gateway::enter(const std::string& room) {
  const std::scoped_lock lock(mutex_);
  ++viewers_[room];
  entered_.insert(room);
}

void Gateway::leave(const std::string& room) {
  const std::scoped_lock lock(mutex_);
  if (--viewers_[room] == 0) viewers_.erase(room);
}

/// Those of rooms that somebody has entered.
void Gateway::startFeeds() {
  const std::scoped_lock lock(mutex_);
  for (const std::string& room : std::exchange(entered_, {})) {
    const auto feed = feeds_.find(room);
    if (feed != feeds_.end()) feed->second->start();
    if (feed != feeds_.end() || room == kLobbyRoom) started_.insert(room);
  }
}

void Gateway::tellRecorded() {
  const std::scoped_lock lock(mutex_);
  for (const auto& [room, feed] : feeds_) feed->setRecorded(desk_.records(feed->sessionName()));
}

/// Whose emergency stop somebody may press.
std::set<std::string> Gateway::expectedSessions() {
  const std::scoped_lock lock(mutex_);
  std::set<std::string> sessions;
  for (const std::string& room : started_) {
    const auto feed = feeds_.find(room);
    sessions.insert(feed == feeds_.end() ? "" : feed->second->sessionName());  // of the lobby: all
  }
  return sessions;
}

std::string Gateway::sessionOf(const std::string& room) {
  const std::scoped_lock lock(mutex_);
  const auto feed = feeds_.find(room);
  if (feed != feeds_.end()) return feed->second->sessionName();
  const std::string prefix = roomOfSession("");
  return room.starts_with(prefix) ? room.substr(prefix.size()) : "";  // of one that has just ended
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
