#include "clients/console/web_server.h"

#include <algorithm>
#include <cctype>

#include "clients/console/foxglove_protocol.h"
#include "clients/console/web_service.h"
#include "idl/wire/identity.h"

namespace tenon::console {

namespace {

constexpr int kSendBuffer =
    256 << 10;  // [bytes] of a socket: what the system keeps for a viewer that does not read
constexpr int kMaxWaitingCalls = 64;

/// Whose connections are counted together. A machine has a network of 64 bits for itself in IPv6.
std::string hostOf(const tcp::socket& socket) {
  beast::error_code error;
  const asio::ip::address address = socket.remote_endpoint(error).address();
  if (error || !address.is_v6()) return address.to_string();
  const asio::ip::address_v6 whole = address.to_v6();
  if (whole.is_v4_mapped()) return asio::ip::make_address_v4(asio::ip::v4_mapped, whole).to_string();
  asio::ip::address_v6::bytes_type network = whole.to_bytes();
  std::fill(network.begin() + 8, network.end(), std::uint8_t{0});
  return asio::ip::make_address_v6(network).to_string();
}

/// The first one of the host that has most of them, with the one that comes; null: there is none.
template <class Connection>
Connection* firstOfMost(const std::vector<Connection*>& connections, const std::string& newcomer) {
  std::map<std::string_view, std::size_t> counts{{newcomer, 1}};
  for (const Connection* const connection : connections) ++counts[connection->host()];
  const auto first = std::max_element(
      connections.begin(), connections.end(),
      [&](const Connection* a, const Connection* b) { return counts[a->host()] < counts[b->host()]; });
  return first == connections.end() ? nullptr : *first;
}

}  // namespace

bool isLoopbackAddress(const std::string& address) {
  beast::error_code error;
  const auto interface = asio::ip::make_address(address, error);
  return !error && interface.is_loopback();
}

Room::Room(std::vector<Channel> channels)
    : store(std::move(channels)), advertisement(advertiseText(store.channels())) {}

WebService::WebService(const WebOptions& web_options, Site web_site, WebHandlers web_handlers)
    : options(web_options),
      site(std::move(web_site)),
      handlers(std::move(web_handlers)),
      session_id(wire::randomHex()) {
  beast::error_code ignored;
  host_name = asio::ip::host_name(ignored);
}

void WebService::accept() {
  acceptor.async_accept([this](beast::error_code error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (!error) {
      std::string host = hostOf(socket);
      if (connections < WebServer::kMaxConnections || makeRoom(host)) {
        beast::error_code ignored;
        socket.set_option(tcp::no_delay(true), ignored);
        socket.set_option(asio::socket_base::send_buffer_size(kSendBuffer), ignored);
        std::make_shared<WebConnection>(*this, std::move(socket), std::move(host))->run();
      }
    }
    accept();
  });
}

void WebService::sendHeartbeats() {
  heartbeat.expires_after(options.heartbeat);
  heartbeat.async_wait([this](beast::error_code error) {
    if (error) return;
    // a viewer that is sent to may end, and leaves the set then
    const std::vector<WebViewer*> all(viewers.begin(), viewers.end());
    for (WebViewer* const viewer : all)
      if (viewers.contains(viewer)) viewer->sendHeartbeat();
    sendHeartbeats();
  });
}

/// For a connection of `host`; false: there is nobody who could make room.
bool WebService::makeRoom(const std::string& host) {
  // who was told to end had its time
  for (WebViewer* const viewer : viewers)
    if (viewer->isClosing()) return viewer->abort(), true;
  WebConnection* const idle = firstOfMost(std::vector(asking.begin(), asking.end()), host);
  if (idle != nullptr) idle->abort();
  return idle != nullptr;
}

void WebService::makeRoomForViewer(const std::string& host) {
  std::vector<WebViewer*> without_place;
  for (WebViewer* const viewer : viewers)
    if (!viewer->hasPlace() && !viewer->isClosing()) without_place.push_back(viewer);
  if (without_place.size() < WebServer::kMaxViewers) return;
  std::sort(without_place.begin(), without_place.end(),
            [](const WebViewer* a, const WebViewer* b) { return a->id() < b->id(); });
  firstOfMost(without_place, host)
      ->close("a newer viewer came: " + std::to_string(WebServer::kMaxViewers) +
              " look on here at most, without a seat or hands");
}

void WebService::deliver(const std::string& path, const std::vector<Publication>& publications) {
  const auto found = rooms.find(path);
  if (found == rooms.end()) return;
  ChannelStore& store = found->second.store;
  for (const Publication& publication : publications) {
    const Channel* channel = store.find(publication.channel);
    if (channel == nullptr) {
      store.clear();
      for (WebViewer* const viewer : viewers)
        if (viewer->room() == path) viewer->dropMessages();
      continue;
    }
    store.keep(publication);
    if (publication.payload == nullptr) continue;
    for (WebViewer* viewer : viewers)
      if (viewer->room() == path) viewer->offer(publication, channel->delivery);
  }
  if (handlers.told)
    for (const std::string& text : store.toTell()) handlers.told(path, text);
  // a viewer that is sent to may end, and leaves the set then
  const std::vector<WebViewer*> all(viewers.begin(), viewers.end());
  for (WebViewer* viewer : all)
    if (viewers.contains(viewer)) viewer->send();
}

void WebService::removeRoom(const std::string& path) {
  if (rooms.erase(path) == 0) return;
  for (WebViewer* viewer : viewers)
    if (viewer->room() == path) viewer->leaveRoom();
}

WebViewer* WebService::find(ViewerId id) {
  const auto found = std::find_if(viewers.begin(), viewers.end(),
                                  [id](const WebViewer* viewer) { return viewer->id() == id; });
  return found == viewers.end() ? nullptr : *found;
}

Result<std::unique_ptr<WebServer>> WebServer::open(const WebOptions& options, Site site,
                                                   WebHandlers handlers) {
  for (const std::string& origin : options.recordings_from)
    if (!isOrigin(origin))
      return fail("--recordings-from " + origin +
                  ": is no server's origin, as https://files.example:8443 is");
  for (const std::string& origin : options.origins) {
    const bool has_capitals =
        std::any_of(origin.begin(), origin.end(), [](unsigned char c) { return std::isupper(c) != 0; });
    if (has_capitals || (origin.ends_with('/') && !origin.ends_with("://")))
      return fail(
          "--allow-origin " + origin +
          ": an origin has no capitals and no path, not even a slash, as https://viewer.example:8443");
  }
  auto impl = std::make_unique<WebService>(options, std::move(site), std::move(handlers));
  if (!options.certificate.empty()) {
    auto certificate = Certificate::read(options.certificate, options.key);
    if (!certificate) return fail(certificate.error().what);
    SSL_CTX_up_ref(certificate->context());  // which the context takes
    impl->tls.emplace(certificate->context());
    impl->certificate = std::move(*certificate);
  }
  beast::error_code error;
  const auto interface = asio::ip::make_address(options.address, error);
  if (error)
    return fail("--listen " + options.address +
                ": is no address of an interface, as 192.168.1.5 or 0.0.0.0 is");
  if (!interface.is_loopback() && !impl->tls && !options.is_plain_permitted)
    return fail(
        "--listen " + options.address +
        ": other machines reach it, so it needs a certificate: `tenon cert` makes one, --tls "
        "CERT,KEY names it. --without-tls does without: then everybody on the network can read along, "
        "keys of seats as well");
  const tcp::endpoint address(interface, options.port);
  impl->acceptor.open(address.protocol(), error);
  if (!error) impl->acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) impl->acceptor.bind(address, error);
  if (!error) impl->acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error)
    return fail("port " + std::to_string(options.port) + " of " + options.address + ": " + error.message() +
                "; name another one with --port, or 0 for any that is free");
  impl->port = impl->acceptor.local_endpoint().port();
  return std::unique_ptr<WebServer>(new WebServer(std::move(impl)));
}

WebServer::WebServer(std::unique_ptr<WebService> impl) : impl_(std::move(impl)) {}
WebServer::~WebServer() { stop(); }

std::uint16_t WebServer::port() const { return impl_->port; }

std::string WebServer::address() const {
  beast::error_code ignored;
  const auto interface = asio::ip::make_address(impl_->options.address, ignored);
  std::string host = "localhost";
  if (impl_->certificate && !interface.is_loopback()) {
    const auto& names = impl_->certificate->names();
    const auto isForOthers = [](const std::string& name) {
      return !isLoopbackHost(name) && name.front() != '*';
    };
    const auto found = std::find_if(names.begin(), names.end(), isForOthers);
    if (found != names.end()) host = *found;
  } else if (!interface.is_loopback()) {
    host = interface.is_unspecified() ? impl_->host_name : interface.to_string();
    if (host.find(':') != std::string::npos) host = "[" + host + "]";
  }
  return (impl_->tls ? "https://" : "http://") + host + ":" + std::to_string(port()) + "/";
}

std::optional<std::chrono::hours> WebServer::certificateValidity() const {
  return impl_->certificate ? std::optional(impl_->certificate->validity()) : std::nullopt;
}

std::size_t WebServer::viewers() const { return impl_->viewer_count; }

void WebServer::start() {
  impl_->accept();
  impl_->sendHeartbeats();
  impl_->thread = std::thread([this] { impl_->io.run(); });
}

void WebServer::addRoom(const std::string& path, std::vector<Channel> channels) {
  asio::post(impl_->io, [impl = impl_.get(), path, channels = std::move(channels)]() mutable {
    impl->rooms.try_emplace(path, std::move(channels));
  });
}

void WebServer::removeRoom(const std::string& path) {
  asio::post(impl_->io, [impl = impl_.get(), path] { impl->removeRoom(path); });
}

void WebServer::publish(const std::string& path, std::vector<Publication> publications) {
  if (publications.empty()) return;
  while (impl_->waiting_calls >= kMaxWaitingCalls && !impl_->io.stopped())
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  ++impl_->waiting_calls;
  asio::post(impl_->io, [impl = impl_.get(), path, publications = std::move(publications)] {
    --impl->waiting_calls;
    impl->deliver(path, publications);
  });
}

void WebServer::answer(ViewerId viewer, DeskAnswer answer) {
  asio::post(impl_->io, [impl = impl_.get(), viewer, answer = std::move(answer)] {
    WebViewer* const found = impl->find(viewer);
    if (found == nullptr) return;
    found->offer(answer);
    found->send();
  });
}

void WebServer::show(ViewerId viewer, Payload views) {
  asio::post(impl_->io, [impl = impl_.get(), viewer, views = std::move(views)] {
    WebViewer* const found = impl->find(viewer);
    if (found == nullptr) return;
    found->offerHands(views);
    found->send();
  });
}

void WebServer::stop() {
  impl_->io.stop();
  if (impl_->thread.joinable()) impl_->thread.join();
  impl_->checker.stop();
  impl_->checker.join();
  impl_->handlers = {};  // viewers that end with this tell nobody
}

}  // namespace tenon::console
