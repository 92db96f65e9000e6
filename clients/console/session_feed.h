#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "clients/console/session_channels.h"
#include "clients/console/web_server.h"
#include "idl/wire/membership.h"
#include "idl/wire/raw_subscriber.h"

namespace tenon::console {

struct FeedOptions {
  std::string room;                               ///< of the WebServer
  std::string session;                            ///< its name; empty: the first one announced
  std::uint32_t domain = 0;                       ///< DDS domain
  std::filesystem::path assets;                   ///< folder of display models
  std::function<void(const std::string&)> print;  ///< gets lines for the terminal; any thread
};

/// Follows a session into a room of the WebServer, once for all viewers: joins it as an observer, and the
/// next one of its name when it ends. A session that is not there yet, refuses or is lost is told to viewers.
///
/// Threads: one of its own, which alone uses DDS; sessionName and setRecorded from any. `server` must outlive
/// it. Real-time: no.
class SessionFeed {
 public:
  SessionFeed(FeedOptions options, WebServer& server);
  ~SessionFeed();
  SessionFeed(const SessionFeed&) = delete;
  SessionFeed& operator=(const SessionFeed&) = delete;

  /// Begins to follow; without effect when it does already.
  void start();
  /// Of the session that is followed; empty when none has been found yet.
  [[nodiscard]] std::string sessionName() const;
  /// Whether this gateway records the session, for viewers.
  void setRecorded(bool is_recorded) { is_recorded_ = is_recorded; }

 private:
  void run();
  void setState(LinkState state, const std::string& reason);
  void serveOneSession();
  void forward(wire::Membership& member, wire::RawSubscriber& subscriber, wire::Inbox& inbox);

  FeedOptions options_;
  WebServer& server_;
  SessionChannels channels_;
  LinkState state_ = LinkState::kSearching;
  std::string reason_;
  mutable std::mutex mutex_;
  std::string session_name_;
  bool is_recorded_told_ = false;
  std::atomic<bool> stop_{false}, is_recorded_{false};
  std::thread thread_;
};

}  // namespace tenon::console
