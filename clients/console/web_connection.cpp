#include "clients/console/answer_body.h"
#include "clients/console/foxglove_protocol.h"
#include "clients/console/web_service.h"

namespace tenon::console {

namespace {

constexpr std::size_t kMaxHeaderBytes = 16U << 10U;
constexpr std::chrono::seconds kRequestTimeout{15};
constexpr std::size_t kMaxBytesASecond = 256U << 10U;  // that are read

std::string_view toView(beast::string_view text) { return {text.data(), text.size()}; }

Answer plain(unsigned status, std::string_view text) {
  return {status, "text/plain; charset=utf-8", false, {text.begin(), text.end()}, {}};
}

}  // namespace

WebConnection::WebConnection(WebService& server, tcp::socket socket, std::string host)
    : server_(server),
      stream_(std::move(socket), kMaxBytesASecond),
      host_(std::move(host)),
      asking_(server.asking.insert(server.asking.end(), this)) {
  ++server_.connections;
}

WebConnection::~WebConnection() {
  if (asking_ != server_.asking.end()) server_.asking.erase(asking_);
  --server_.connections;
}

void WebConnection::abort() {
  server_.asking.erase(asking_);
  asking_ = server_.asking.end();
  beast::error_code ignored;
  stream_.next_layer().socket().close(ignored);
}

void WebConnection::run() {
  if (!server_.tls) return read();
  // who speaks plain HTTP to a port with TLS is told so
  stream_.next_layer().expires_after(kRequestTimeout);
  beast::async_detect_ssl(stream_.next_layer(), incoming_,
                          [self = shared_from_this()](beast::error_code error, bool is_tls) {
                            if (error) return;
                            is_tls ? self->handshake() : self->read();
                          });
}

void WebConnection::handshake() {
  stream_.next_layer().expires_after(kRequestTimeout);
  stream_.handshake(*server_.tls, incoming_.data(),
                    [self = shared_from_this()](beast::error_code error, std::size_t taken) {
                      self->incoming_.consume(taken);
                      if (!error) self->read();
                    });
}

void WebConnection::read() {
  parser_.emplace();
  parser_->header_limit(kMaxHeaderBytes);
  parser_->body_limit(std::uint64_t{0});
  stream_.next_layer().expires_after(kRequestTimeout);
  http::async_read(
      stream_, incoming_, *parser_, [self = shared_from_this()](beast::error_code error, std::size_t) {
        if (error || self->asking_ == self->server_.asking.end()) return;
        self->server_.asking.splice(self->server_.asking.end(), self->server_.asking, self->asking_);
        self->handle();
      });
}

namespace {
/// Names of hosts have no case; browsers send small letters.
bool isSameName(std::string_view a, std::string_view b) {
  return beast::iequals({a.data(), a.size()}, {b.data(), b.size()});
}
}  // namespace

/// Names that somebody else's DNS server points here are not.
bool WebConnection::isPermittedHost(std::string_view host) const {
  if (isLoopbackHost(host)) return true;
  if (server_.certificate) return server_.certificate->covers(host);
  return server_.options.is_plain_permitted &&
         (isAddress(host) || isSameName(nameOfHost(host), server_.host_name));
}

void WebConnection::handle() {
  const Request request = parser_->release();
  const std::string_view host = toView(request[http::field::host]);
  const std::string_view target = toView(request.target());
  // RFC 9112 section 3.2: of several a proxy may read another one than we do
  if (request.count(http::field::host) > 1 || request.count(http::field::origin) > 1) {
    respond(request, plain(400, "one Host and one Origin at most"));
  } else if (!isPermittedHost(host)) {
    respond(request,
            plain(403, server_.certificate
                           ? "this server answers to the names in its certificate and to localhost"
                       : server_.options.is_plain_permitted
                           ? "this server answers to addresses, to this machine's own name and to localhost"
                           : "this server answers to localhost only"));
  } else if (server_.tls && !stream_.isSecure()) {
    Answer answer = plain(target.starts_with('/') && !websocket::is_upgrade(request) ? 308 : 400,
                          "this server speaks https and wss on this port");
    if (answer.status == 308)
      answer.headers.emplace_back("Location", "https://" + std::string(host) + std::string(target));
    respond(request, std::move(answer));
  } else if (websocket::is_upgrade(request)) {
    handleUpgrade(request, toView(request[http::field::origin]), host);
  } else if (request.method() != http::verb::get && request.method() != http::verb::head) {
    respond(request, plain(405, "GET and HEAD only"));
  } else {
    // If-Range: a range only of the content that the other side has; nothing here says which that is
    const bool is_get = request.method() == http::verb::get;
    const bool has_range = is_get && request.find(http::field::if_range) == request.end();
    const std::string_view range = has_range ? toView(request[http::field::range]) : std::string_view();
    const auto unchecked = is_get && range.empty() ? server_.site.unchecked(target) : std::nullopt;
    if (unchecked) return check(request, *unchecked);
    respond(request, server_.site.answer(target, range));
  }
}

/// Serves all of an asset once another thread has read it.
void WebConnection::check(const Request& request, const std::string& name) {
  const FileVersion version = versionOf(server_.site.assets().fileOf(name));
  asio::post(server_.checker, [self = shared_from_this(), request, name, version,
                               assets = server_.site.assets()]() mutable {
    const bool is_right = assets.get(name).has_value();
    asio::io_context& io = self->server_.io;
    asio::post(io, [self = std::move(self), request = std::move(request), name, version, is_right] {
      if (self->asking_ == self->server_.asking.end()) return;
      if (!is_right) return self->respond(request, plain(404, "there is no such asset"));
      self->server_.site.setChecked(name, version);
      self->respond(request, self->server_.site.answer(toView(request.target())));
    });
  });
}

void WebConnection::handleUpgrade(const Request& request, std::string_view origin, std::string_view host) {
  const auto subprotocol = chooseSubprotocol(toView(request[http::field::sec_websocket_protocol]));
  const std::string path = roomOf(toView(request.target()));
  if (!isPermittedOrigin(origin, host, stream_.isSecure(), server_.options.origins)) {
    respond(request, plain(403, "pages of this origin may not connect; --allow-origin permits it"));
  } else if (!isHandshakeKey(toView(request[http::field::sec_websocket_key]))) {
    respond(request, plain(400, "Sec-WebSocket-Key is not 16 bytes in base64"));
  } else if (!subprotocol) {
    respond(request, plain(400, "offer the subprotocol foxglove.sdk.v1 or foxglove.websocket.v1"));
  } else {
    stream_.next_layer().expires_never();
    const bool is_own = isPermittedOrigin(origin, host, stream_.isSecure(), {});
    const WebViewer::From from = !is_own          ? WebViewer::From::kElsewhere
                                 : origin.empty() ? WebViewer::From::kProgram
                                                  : WebViewer::From::kOwnPage;
    // one without a room does not stay
    if (server_.rooms.contains(path)) server_.makeRoomForViewer(host_);
    std::make_shared<WebViewer>(server_, std::move(stream_), host_, path, from)->run(request, *subprotocol);
  }
}

/// An answer while it is sent.
struct WebConnection::Response {
  http::response<AnswerBody> message;
  std::optional<http::response_serializer<AnswerBody>> serializer;
};

void WebConnection::respond(const Request& request, Answer answer) {
  const bool has_body = request.method() != http::verb::head;
  const auto response = std::make_shared<Response>();
  auto& message = response->message;
  if (has_body && answer.part && !message.body().open(*answer.part))
    answer = plain(404, "the file cannot be read there");
  const std::uint64_t size = answer.part ? answer.part->size : answer.body.size();
  message.version(request.version());
  message.result(answer.status);
  message.keep_alive(request.keep_alive() && answer.status < 300);
  message.set(http::field::server, "tenon");
  message.set(http::field::content_type, answer.type);
  message.set(http::field::cache_control,
              answer.is_immutable ? "public, max-age=31536000, immutable" : "no-cache");
  message.set("Content-Security-Policy", contentSecurityPolicy(server_.options.recordings_from));
  for (const auto& [name, value] : answer.headers) message.set(name, value);
  message.set("X-Content-Type-Options", "nosniff");
  message.set("Referrer-Policy", "no-referrer");
  message.set("Cross-Origin-Resource-Policy", "same-origin");
  message.content_length(size);
  if (has_body && !answer.part) message.body().hold(std::move(answer.body));
  response->serializer.emplace(message);
  send(response);
}

/// As much as is taken at once; the time that is permitted begins anew with each piece.
void WebConnection::send(const std::shared_ptr<Response>& response) {
  stream_.next_layer().expires_after(server_.options.send_timeout);
  http::async_write_some(stream_, *response->serializer,
                         [self = shared_from_this(), response](beast::error_code error, std::size_t) {
                           if (error) return;
                           if (!response->serializer->is_done()) return self->send(response);
                           if (response->message.keep_alive()) return self->read();
                           self->stream_.next_layer().expires_after(kRequestTimeout);
                           self->stream_.end([self](beast::error_code) {});
                         });
}

}  // namespace tenon::console
