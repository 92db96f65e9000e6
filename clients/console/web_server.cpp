#include "clients/console/web_server.h"

#include <algorithm>
#include <cctype>

#include "clients/console/foxglove_protocol.h"
#include "clients/console/web_service.h"
#include "idl/wire/identity.h"

namespace tenon::console {

namespace {

constexpr std::size_t kMaxConnections = 256;
constexpr int kSendBuffer =
    256 << 10;  // [bytes] of a socket: what the system keeps for a viewer that does not read
constexpr int kMaxWaitingCalls = 64;

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
    // beyond the limit the one that has asked for nothing for longest makes room, else it is closed at once
    const bool is_full = connections >= kMaxConnections;
    if (!error && (!is_full || !waiting.empty())) {
      if (is_full) waiting.front()->abort();
      beast::error_code ignored;
      socket.set_option(tcp::no_delay(true), ignored);
      socket.set_option(asio::socket_base::send_buffer_size(kSendBuffer), ignored);
      std::make_shared<WebConnection>(*this, std::move(socket))->run();
    }
    accept();
  });
}

void WebService::deliver(const std::string& path, const std::vector<Publication>& publications) {
  const auto found = rooms.find(path);
  if (found == rooms.end()) return;
  ChannelStore& store = found->second.store;
  for (const Publication& publication : publications) {
    const Channel* channel = store.find(publication.channel);
    if (channel == nullptr) {
      store.clear();
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

void WebServer::answer(ViewerId viewer, std::string text) {
  asio::post(impl_->io, [impl = impl_.get(), viewer, text = std::move(text)] {
    WebViewer* const found = impl->find(viewer);
    if (found == nullptr) return;
    found->offer(text);
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
  impl_->handlers = {};  // viewers that end with this tell nobody
}

}  // namespace tenon::console
