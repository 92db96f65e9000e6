#pragma once

#include <utility>  // before Asio 1.18, which uses std::exchange without it
#include <variant>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/host_name.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>

namespace tenon::console {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using tcp = asio::ip::tcp;

/// One connection, in plain or within TLS: a stream as Boost.Beast wants it, so that HTTP and WebSocket are
/// the same over both.
///
/// What is sent to it is read at a bounded rate: TLS records and WebSocket frames that carry nothing are no
/// messages, and cost as much.
///
/// Threads: one. Real-time: no.
class WebStream {
 public:
  using Plain = beast::basic_stream<tcp, asio::any_io_executor, beast::simple_rate_policy>;
  using Secure = beast::ssl_stream<Plain>;
  using executor_type = Plain::executor_type;

  WebStream(tcp::socket socket, std::size_t bytes_a_second)
      : stream_(std::in_place_type<Plain>, std::move(socket)) {
    next_layer().rate_policy().read_limit(bytes_a_second);
  }

  [[nodiscard]] bool isSecure() const { return std::holds_alternative<Secure>(stream_); }
  /// The stream below TLS, with its timeouts.
  [[nodiscard]] Plain& next_layer() {
    if (auto* const secure = std::get_if<Secure>(&stream_)) return secure->next_layer();
    return std::get<Plain>(stream_);
  }
  [[nodiscard]] executor_type get_executor() { return next_layer().get_executor(); }

  /// From now on within TLS. `handler` is told whether the handshake has succeeded, and how many bytes of
  /// `received`, what was read so far, it has taken.
  template <class Handler>
  void handshake(asio::ssl::context& tls, asio::const_buffer received, Handler&& handler) {
    Plain plain = std::move(std::get<Plain>(stream_));
    stream_.emplace<Secure>(std::move(plain), tls)
        .async_handshake(asio::ssl::stream_base::server, received, std::forward<Handler>(handler));
  }

  /// Tells the other side that nothing follows. `handler`: void(beast::error_code).
  template <class Handler>
  void end(Handler&& handler) {
    if (auto* const secure = std::get_if<Secure>(&stream_))
      return secure->async_shutdown(std::forward<Handler>(handler));
    beast::error_code error;
    next_layer().socket().shutdown(tcp::socket::shutdown_send, error);
    asio::post(get_executor(),
               [handler = std::forward<Handler>(handler), error]() mutable { handler(error); });
  }

  template <class Buffers, class Handler>
  void async_read_some(const Buffers& buffers, Handler&& handler) {
    std::visit([&](auto& stream) { stream.async_read_some(buffers, std::forward<Handler>(handler)); },
               stream_);
  }
  template <class Buffers, class Handler>
  void async_write_some(const Buffers& buffers, Handler&& handler) {
    std::visit([&](auto& stream) { stream.async_write_some(buffers, std::forward<Handler>(handler)); },
               stream_);
  }

  /// How a WebSocket of it ends; found by Boost.Beast.
  template <class Handler>
  friend void async_teardown(beast::role_type role, WebStream& stream, Handler&& handler) {
    using websocket::async_teardown;
    std::visit([&](auto& inner) { async_teardown(role, inner, std::forward<Handler>(handler)); },
               stream.stream_);
  }
  friend void teardown(beast::role_type role, WebStream& stream, beast::error_code& error) {
    using websocket::teardown;
    std::visit([&](auto& inner) { teardown(role, inner, error); }, stream.stream_);
  }

 private:
  std::variant<Plain, Secure> stream_;
};

}  // namespace tenon::console
