#include "clients/console/web_server.h"

#include <chrono>
#include <deque>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <thread>
#include <utility>  // before Asio 1.18, which uses std::exchange without it

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>

#include "clients/console/channel_store.h"
#include "clients/console/foxglove_protocol.h"
#include "clients/console/viewer_queue.h"

namespace tenon::console {

namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using tcp = asio::ip::tcp;
using std::chrono::seconds;

constexpr std::size_t kMaxConnections = 256;
constexpr std::size_t kMaxHeaderBytes = 16U << 10U;
constexpr std::size_t kMaxMessageBytes = 64U << 10U;
constexpr std::size_t kMaxSubscriptions = 256;
constexpr int kMaxMessagesASecond = 200;
constexpr int kSendBuffer =
    256 << 10;  // [bytes] of a socket: what the system keeps for a viewer that does not read
constexpr seconds kRequestTimeout{15};
constexpr seconds kSendTimeout{20};
constexpr int kMaxWaitingCalls = 64;

/// Of the version of this program's page and this connection's life.
std::string randomText() {
  std::random_device source;
  return std::to_string(source()) + std::to_string(source());
}

}  // namespace

/// What all connections share; served by one thread.
struct WebServer::Impl {
  Impl(const WebOptions& web_options, Site web_site, std::vector<Channel> channels)
      : options(web_options),
        site(std::move(web_site)),
        store(std::move(channels)),
        advertisement(std::make_shared<const std::string>(advertiseText(store.channels()))) {}

  class Viewer;
  class Connection;
  void accept();
  void deliver(const std::vector<Publication>& publications);

  WebOptions options;
  Site site;
  ChannelStore store;
  std::shared_ptr<const std::string> advertisement;
  std::string session_id = randomText();

  std::uint16_t port = 0;
  std::size_t connections = 0;
  std::set<Viewer*> viewers;
  std::atomic<std::size_t> viewer_count{0};
  std::atomic<int> waiting_calls{0};
  // after what connections refer to: they end with it
  asio::io_context io{1};
  tcp::acceptor acceptor{io};
  std::thread thread;
};

/// One WebSocket connection. It lives as long as an operation of it is pending.
class WebServer::Impl::Viewer : public std::enable_shared_from_this<Viewer> {
 public:
  Viewer(Impl& server, tcp::socket socket)
      : server_(server), socket_(std::move(socket)), send_timer_(server.io) {
    ++server_.connections;
  }
  ~Viewer() {
    server_.viewers.erase(this);
    server_.viewer_count = server_.viewers.size();
    --server_.connections;
  }
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;

  void run(const http::request<http::empty_body>& request, std::string_view subprotocol) {
    auto timeout = websocket::stream_base::timeout::suggested(beast::role_type::server);
    timeout.idle_timeout = seconds(60);
    timeout.keep_alive_pings = true;
    socket_.set_option(timeout);
    socket_.set_option(websocket::stream_base::decorator(
        [name = std::string(subprotocol)](websocket::response_type& answer) {
          answer.set(http::field::sec_websocket_protocol, name);
          answer.set(http::field::server, "tenon");
        }));
    socket_.read_message_max(kMaxMessageBytes);
    socket_.async_accept(request, [self = shared_from_this()](beast::error_code error) {
      if (!error) self->begin();
    });
  }

  void offer(const Publication& publication, Delivery delivery) {
    for (const auto& [subscription, channel] : subscriptions_)
      if (channel == publication.channel) queue_.add(subscription, delivery, publication);
  }
  void send() {
    if (is_sending_ || is_closing_) return;
    if (queue_.hasOverflowed()) {
      close("more was asked for than was read");
      return;
    }
    auto item = queue_.take();
    if (!item) return;
    sent_ = std::move(*item);
    is_sending_ = true;
    send_timer_.expires_after(kSendTimeout);
    send_timer_.async_wait([self = weak_from_this()](beast::error_code error) {
      const auto viewer = self.lock();
      if (!error && viewer) viewer->abort();
    });
    const bool is_text = sent_.payload == nullptr;
    socket_.text(is_text);
    const std::array<asio::const_buffer, 2> buffers{
        is_text ? asio::buffer(sent_.text) : asio::const_buffer(asio::buffer(sent_.header)),
        is_text ? asio::const_buffer() : asio::buffer(*sent_.payload)};
    socket_.async_write(buffers, [self = shared_from_this()](beast::error_code error, std::size_t) {
      self->is_sending_ = false;
      self->send_timer_.cancel();
      self->sent_ = {};
      if (error) return;
      self->send();
      if (self->is_closing_) self->finish();
    });
  }

 private:
  void begin() {
    server_.viewers.insert(this);
    server_.viewer_count = server_.viewers.size();
    queue_.addText(serverInfoText(server_.options.name, server_.session_id));
    queue_.addText(*server_.advertisement);
    send();
    read();
  }

  void read() {
    socket_.async_read(incoming_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error) {
        self->abort();
        return;
      }
      self->receive();
      if (!self->is_closing_) self->read();
    });
  }

  void receive() {
    const auto now = std::chrono::steady_clock::now();
    if (now - second_ > seconds(1)) {
      second_ = now;
      received_ = 0;
    }
    if (++received_ > kMaxMessagesASecond) {
      close("more than 200 messages a second");
      return;
    }
    const std::string text = beast::buffers_to_string(incoming_.data());
    incoming_.consume(incoming_.size());
    if (!socket_.got_text()) {
      queue_.addText(statusText(StatusLevel::kWarning, "binary messages are not expected here"));
    } else if (const auto request = parseViewerText(text)) {
      apply(*request);
    } else {
      queue_.addText(statusText(StatusLevel::kWarning, "not understood: " + request.error().what));
    }
    send();
  }

  void apply(const ViewerRequest& request) {
    for (const SubscriptionId id : request.unsubscribe) {
      subscriptions_.erase(id);
      queue_.remove(id);
    }
    for (const auto& [id, channel] : request.subscribe) {
      const Channel* found = server_.store.find(channel);
      std::string problem;
      if (found == nullptr) problem = "there is no channel " + std::to_string(channel);
      if (subscriptions_.contains(id)) problem = "subscription " + std::to_string(id) + " exists";
      if (subscriptions_.size() >= kMaxSubscriptions) problem = "there are too many subscriptions";
      if (!problem.empty()) {
        queue_.addText(statusText(StatusLevel::kWarning, problem));
        continue;
      }
      subscriptions_.emplace(id, channel);
      server_.store.forEachKept(
          channel, [&, name = id](const Publication& kept) { queue_.add(name, found->delivery, kept); });
    }
  }

  void close(const std::string& reason) {
    is_closing_ = true;
    close_reason_ = reason;
    if (!is_sending_) finish();
  }
  void finish() {
    if (is_closed_) return;
    is_closed_ = true;
    send_timer_.expires_after(kSendTimeout);
    send_timer_.async_wait([self = weak_from_this()](beast::error_code error) {
      const auto viewer = self.lock();
      if (!error && viewer) viewer->abort();
    });
    socket_.async_close({websocket::close_code::policy_error, close_reason_},
                        [self = shared_from_this()](beast::error_code) { self->send_timer_.cancel(); });
  }
  /// Ends the connection without waiting for the other side.
  void abort() {
    is_closing_ = is_closed_ = true;
    send_timer_.cancel();
    beast::error_code ignored;
    socket_.next_layer().close(ignored);
  }

  Impl& server_;
  websocket::stream<tcp::socket> socket_;
  asio::steady_timer send_timer_;
  beast::flat_buffer incoming_;
  std::map<SubscriptionId, ChannelId> subscriptions_;
  ViewerQueue queue_;
  ViewerQueue::Item sent_;
  std::string close_reason_;
  std::chrono::steady_clock::time_point second_;
  int received_ = 0;  ///< messages, since second_
  bool is_sending_ = false;
  bool is_closing_ = false;
  bool is_closed_ = false;
};

/// One HTTP connection, which may become a viewer's.
class WebServer::Impl::Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(Impl& server, tcp::socket socket) : server_(server), stream_(std::move(socket)) {
    ++server_.connections;
  }
  ~Connection() { --server_.connections; }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void read() {
    parser_.emplace();
    parser_->header_limit(kMaxHeaderBytes);
    parser_->body_limit(std::uint64_t{0});
    stream_.expires_after(kRequestTimeout);
    http::async_read(stream_, incoming_, *parser_,
                     [self = shared_from_this()](beast::error_code error, std::size_t) {
                       if (!error) self->handle();
                     });
  }

 private:
  using Request = http::request<http::empty_body>;

  void handle() {
    const Request request = parser_->release();
    const std::string_view host = toView(request[http::field::host]);
    const std::string_view origin = toView(request[http::field::origin]);
    if (!isLoopbackHost(host)) {
      respond(request, plain(403, "this server answers to localhost only"));
    } else if (websocket::is_upgrade(request)) {
      const auto subprotocol = chooseSubprotocol(toView(request[http::field::sec_websocket_protocol]));
      if (!isPermittedOrigin(origin, host, server_.options.origins)) {
        respond(request, plain(403, "pages of this origin may not connect; --allow-origin permits it"));
      } else if (!subprotocol) {
        respond(request, plain(400, "offer the subprotocol foxglove.sdk.v1 or foxglove.websocket.v1"));
      } else {
        stream_.expires_never();
        std::make_shared<Viewer>(server_, stream_.release_socket())->run(request, *subprotocol);
      }
    } else if (request.method() != http::verb::get && request.method() != http::verb::head) {
      respond(request, plain(405, "GET and HEAD only"));
    } else {
      respond(request, server_.site.answer(toView(request.target())));
    }
  }

  static std::string_view toView(beast::string_view text) { return {text.data(), text.size()}; }
  static Answer plain(unsigned status, std::string_view text) {
    return {status, "text/plain; charset=utf-8", false, {text.begin(), text.end()}};
  }

  void respond(const Request& request, Answer answer) {
    auto response = std::make_shared<http::response<http::vector_body<std::uint8_t>>>();
    response->version(request.version());
    response->result(answer.status);
    response->keep_alive(request.keep_alive() && answer.status < 400);
    response->set(http::field::server, "tenon");
    response->set(http::field::content_type, answer.type);
    response->set(http::field::cache_control,
                  answer.is_immutable ? "public, max-age=31536000, immutable" : "no-cache");
    const std::string_view policy = contentSecurityPolicy();
    response->set("Content-Security-Policy", beast::string_view(policy.data(), policy.size()));
    response->set("X-Content-Type-Options", "nosniff");
    response->set("Referrer-Policy", "no-referrer");
    response->set("Cross-Origin-Resource-Policy", "same-origin");
    const std::size_t size = answer.body.size();
    if (request.method() != http::verb::head) response->body() = std::move(answer.body);
    response->content_length(size);
    stream_.expires_after(kSendTimeout);
    http::async_write(stream_, *response,
                      [self = shared_from_this(), response](beast::error_code error, std::size_t) {
                        if (!error && response->keep_alive()) return self->read();
                        beast::error_code ignored;
                        self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
                      });
  }

  Impl& server_;
  beast::tcp_stream stream_;
  beast::flat_buffer incoming_;
  std::optional<http::request_parser<http::empty_body>> parser_;
};

void WebServer::Impl::accept() {
  acceptor.async_accept([this](beast::error_code error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    // beyond the limit it is closed at once
    if (!error && connections < kMaxConnections) {
      beast::error_code ignored;
      socket.set_option(tcp::no_delay(true), ignored);
      socket.set_option(asio::socket_base::send_buffer_size(kSendBuffer), ignored);
      std::make_shared<Connection>(*this, std::move(socket))->read();
    }
    accept();
  });
}

void WebServer::Impl::deliver(const std::vector<Publication>& publications) {
  for (const Publication& publication : publications) {
    const Channel* channel = store.find(publication.channel);
    if (channel == nullptr) {
      store.clear();
      continue;
    }
    store.keep(publication);
    if (publication.payload == nullptr) continue;
    for (Viewer* viewer : viewers) viewer->offer(publication, channel->delivery);
  }
  // a viewer that is sent to may end, and leaves the set then
  const std::vector<Viewer*> all(viewers.begin(), viewers.end());
  for (Viewer* viewer : all)
    if (viewers.contains(viewer)) viewer->send();
}

Result<std::unique_ptr<WebServer>> WebServer::open(const WebOptions& options, Site site,
                                                   std::vector<Channel> channels) {
  auto impl = std::make_unique<Impl>(options, std::move(site), std::move(channels));
  const tcp::endpoint address(asio::ip::address_v4::loopback(), options.port);
  beast::error_code error;
  impl->acceptor.open(address.protocol(), error);
  if (!error) impl->acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) impl->acceptor.bind(address, error);
  if (!error) impl->acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error)
    return fail("port " + std::to_string(options.port) + " of 127.0.0.1: " + error.message() +
                "; name another one with --port, or 0 for any that is free");
  impl->port = impl->acceptor.local_endpoint().port();
  return std::unique_ptr<WebServer>(new WebServer(std::move(impl)));
}

WebServer::WebServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
WebServer::~WebServer() { stop(); }

std::uint16_t WebServer::port() const { return impl_->port; }
std::size_t WebServer::viewers() const { return impl_->viewer_count; }

void WebServer::start() {
  impl_->accept();
  impl_->thread = std::thread([this] { impl_->io.run(); });
}

void WebServer::publish(std::vector<Publication> publications) {
  if (publications.empty()) return;
  while (impl_->waiting_calls >= kMaxWaitingCalls && !impl_->io.stopped())
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  ++impl_->waiting_calls;
  asio::post(impl_->io, [impl = impl_.get(), publications = std::move(publications)] {
    --impl->waiting_calls;
    impl->deliver(publications);
  });
}

void WebServer::stop() {
  impl_->io.stop();
  if (impl_->thread.joinable()) impl_->thread.join();
}

}  // namespace tenon::console
