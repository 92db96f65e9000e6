#pragma once

#include <atomic>
#include <chrono>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "clients/console/certificate.h"
#include "clients/console/channel_store.h"
#include "clients/console/site.h"
#include "clients/console/viewer_queue.h"
#include "clients/console/web_options.h"
#include "clients/console/web_stream.h"

/// The parts of the WebServer; nobody else includes this. All runs in the server's one thread, but the checks
/// of assets.
namespace tenon::console {

struct WebService;

/// One WebSocket connection. It lives as long as an operation of it is pending.
class WebViewer : public std::enable_shared_from_this<WebViewer> {
 public:
  enum class From { kOwnPage, kProgram, kElsewhere };  ///< a page of this server, none, or another's

  /// `host`: whose connections are counted together.
  WebViewer(WebService& server, WebStream stream, std::string host, std::string room, From from);
  ~WebViewer();
  WebViewer(const WebViewer&) = delete;
  WebViewer& operator=(const WebViewer&) = delete;

  void run(const http::request<http::empty_body>& request, std::string_view subprotocol);
  void offer(const Publication& publication, Delivery delivery);
  void offer(const DeskAnswer& answer);
  void offerHands(const Payload& views) {
    queue_.add(kHandSubscription, Delivery::kNewest, {.payload = views});
  }
  void send();
  /// What waits is of a session that is no more.
  void dropMessages();
  /// To a page of this server, so that it knows of a connection that has broken unnoticed.
  void sendHeartbeat();
  /// The connection is closed: its room is no more.
  void leaveRoom();
  void close(const std::string& reason, websocket::close_code code = websocket::close_code::policy_error);
  /// Ends the connection without waiting for the other side.
  void abort();
  [[nodiscard]] ViewerId id() const { return id_; }
  [[nodiscard]] const std::string& host() const { return host_; }
  [[nodiscard]] const std::string& room() const { return room_; }
  /// Has a seat or hands.
  [[nodiscard]] bool hasPlace() const { return has_seat_ || has_hands_; }
  [[nodiscard]] bool isClosing() const { return is_closing_; }

 private:
  void begin();
  void read();
  void receive();
  /// A binary message.
  void moveHands(std::span<const std::uint8_t> targets);
  void apply(const ViewerRequest& request);
  void finish();
  /// It is none of the server's viewers any more.
  void leave();

  WebService& server_;
  ViewerId id_;
  std::string host_;
  std::string room_;
  From from_;
  websocket::stream<WebStream> socket_;
  asio::steady_timer send_timer_;
  beast::flat_buffer incoming_;
  std::map<SubscriptionId, ChannelId> subscriptions_;
  ViewerQueue queue_;
  ViewerQueue::Item sent_;
  websocket::close_reason close_reason_;
  std::chrono::steady_clock::time_point second_;
  int received_ = 0;  ///< messages, since second_
  bool has_seat_ = false, has_hands_ = false;
  bool is_sending_ = false;
  bool is_closing_ = false;
  bool is_closed_ = false;
};

/// One HTTP connection, which may become a viewer's.
class WebConnection : public std::enable_shared_from_this<WebConnection> {
 public:
  WebConnection(WebService& server, tcp::socket socket, std::string host);
  ~WebConnection();
  WebConnection(const WebConnection&) = delete;
  WebConnection& operator=(const WebConnection&) = delete;

  void run();
  /// Ends it without an answer.
  void abort();
  [[nodiscard]] const std::string& host() const { return host_; }

 private:
  using Request = http::request<http::empty_body>;
  void handshake();
  void read();
  void handle();
  [[nodiscard]] bool isPermittedHost(std::string_view host) const;
  void handleUpgrade(const Request& request, std::string_view origin, std::string_view host);
  void check(const Request& request, const std::string& name);
  struct Response;
  void respond(const Request& request, Answer answer);
  void send(const std::shared_ptr<Response>& response);

  WebService& server_;
  WebStream stream_;
  std::string host_;  ///< whose connections are counted together
  beast::flat_buffer incoming_;
  std::optional<http::request_parser<http::empty_body>> parser_;
  std::list<WebConnection*>::iterator asking_;  ///< in WebService::asking, or its end
};

/// The channels of one session.
struct Room {
  explicit Room(std::vector<Channel> channels);

  ChannelStore store;
  std::string advertisement;
};

/// What all connections share.
struct WebService {
  WebService(const WebOptions& web_options, Site web_site, WebHandlers web_handlers);

  void accept();
  void sendHeartbeats();
  bool makeRoom(const std::string& host);
  /// One of `host` comes.
  void makeRoomForViewer(const std::string& host);
  void deliver(const std::string& path, const std::vector<Publication>& publications);
  void removeRoom(const std::string& path);
  /// Null when it is not there any more.
  [[nodiscard]] WebViewer* find(ViewerId viewer);

  WebOptions options;
  std::optional<Certificate> certificate;  ///< none: without TLS
  std::optional<asio::ssl::context> tls;
  Site site;
  WebHandlers handlers;
  std::map<std::string, Room, std::less<>> rooms;  ///< by path
  std::string session_id;                          ///< of this server's life

  std::string host_name;  ///< of this machine
  std::uint16_t port = 0;
  std::size_t connections = 0;
  std::list<WebConnection*> asking;  ///< the one that has asked for nothing for longest first
  std::set<WebViewer*> viewers;
  ViewerId next_viewer = 1;
  std::atomic<std::size_t> viewer_count{0};
  std::atomic<int> waiting_calls{0};
  // after what connections refer to: they end with it
  asio::io_context io{1};
  tcp::acceptor acceptor{io};
  asio::steady_timer heartbeat{io};
  asio::thread_pool checker{1};  ///< of assets; one at a time, so that one at most is in memory
  std::thread thread;
};

}  // namespace tenon::console
