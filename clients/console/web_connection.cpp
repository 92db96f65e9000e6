#include "clients/console/foxglove_protocol.h"
#include "clients/console/web_service.h"

namespace tenon::console {

namespace {

constexpr std::size_t kMaxHeaderBytes = 16U << 10U;
constexpr std::chrono::seconds kRequestTimeout{15};

std::string_view toView(beast::string_view text) { return {text.data(), text.size()}; }

Answer plain(unsigned status, std::string_view text) {
  return {status, "text/plain; charset=utf-8", false, {text.begin(), text.end()}, {}};
}

}  // namespace

WebConnection::WebConnection(WebService& server, tcp::socket socket)
    : server_(server), stream_(std::move(socket)), waiting_(server.waiting.end()) {
  ++server_.connections;
}

WebConnection::~WebConnection() {
  stopWaiting();
  --server_.connections;
}

void WebConnection::stopWaiting() {
  if (waiting_ != server_.waiting.end()) server_.waiting.erase(waiting_);
  waiting_ = server_.waiting.end();
}

void WebConnection::abort() {
  stopWaiting();
  beast::error_code ignored;
  stream_.socket().close(ignored);
}

void WebConnection::read() {
  parser_.emplace();
  parser_->header_limit(kMaxHeaderBytes);
  parser_->body_limit(std::uint64_t{0});
  stream_.expires_after(kRequestTimeout);
  waiting_ = server_.waiting.insert(server_.waiting.end(), this);
  http::async_read(stream_, incoming_, *parser_,
                   [self = shared_from_this()](beast::error_code error, std::size_t) {
                     self->stopWaiting();
                     if (!error) self->handle();
                   });
}

void WebConnection::handle() {
  const Request request = parser_->release();
  const std::string_view host = toView(request[http::field::host]);
  if (!isLoopbackHost(host)) {
    respond(request, plain(403, "this server answers to localhost only"));
  } else if (websocket::is_upgrade(request)) {
    handleUpgrade(request, toView(request[http::field::origin]), host);
  } else if (request.method() != http::verb::get && request.method() != http::verb::head) {
    respond(request, plain(405, "GET and HEAD only"));
  } else {
    respond(request, server_.site.answer(toView(request.target()), toView(request[http::field::range])));
  }
}

void WebConnection::handleUpgrade(const Request& request, std::string_view origin, std::string_view host) {
  const auto subprotocol = chooseSubprotocol(toView(request[http::field::sec_websocket_protocol]));
  const std::string path = roomOf(toView(request.target()));
  if (!isPermittedOrigin(origin, host, server_.options.origins)) {
    respond(request, plain(403, "pages of this origin may not connect; --allow-origin permits it"));
  } else if (!subprotocol) {
    respond(request, plain(400, "offer the subprotocol foxglove.sdk.v1 or foxglove.websocket.v1"));
  } else if (!server_.rooms.contains(path)) {
    respond(request,
            plain(404, "there is no session of this name, or more sessions than this gateway shows"));
  } else {
    stream_.expires_never();
    const bool is_own_page = isPermittedOrigin(origin, host, {});
    std::make_shared<WebViewer>(server_, stream_.release_socket(), path, is_own_page)
        ->run(request, *subprotocol);
  }
}

void WebConnection::respond(const Request& request, Answer answer) {
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
  for (const auto& [name, value] : answer.headers) response->set(name, value);
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

}  // namespace tenon::console
