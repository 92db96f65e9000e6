#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/console/channel.h"
#include "clients/console/site.h"
#include "clients/console/web_options.h"
#include "idl/types/result.h"

namespace tenon::console {

struct WebService;  ///< in web_service.h

/// Whether an address of an interface, as of --listen, is reached from this machine alone.
[[nodiscard]] bool isLoopbackAddress(const std::string& address);

/// The HTTP and WebSocket server of the gateway, in plain or within TLS; beyond the loopback interface only
/// with a certificate, or when that is dispensed with. Who speaks plain HTTP to a port with TLS is sent to
/// https.
///
/// HTTP: a Site. WebSocket: the Foxglove protocol, in rooms, which are paths; each has the channels of one
/// session. Who asks for a room that is not there is told so by the reason of the close. Pages of this server
/// get a heartbeat. A connection that takes nothing of what is sent for 20 s ends. A viewer has a
/// ViewerQueue; one that sends more than 400 messages a second, or messages longer than 64 kB, is
/// disconnected; 256 kB a second are read of it. The handshake of TLS and each request have 15 s. A request
/// must name a loopback host or one of the certificate's, and a WebSocket one a permitted origin.
///
/// Nobody is kept out by many others: of kMaxConnections, viewers without a place (a seat or hands) have
/// kMaxViewers. When more viewers come, the oldest one without a place ends, told why; when more connections
/// come, the one that has asked for nothing for longest: of the remote address that has most of them.
///
/// Threads: open, start and stop from one thread; it has a thread of its own, which alone serves, and one
/// that checks assets. The others from any. Real-time: no.
class WebServer {
 public:
  static constexpr std::size_t kMaxConnections = 256;
  static constexpr std::size_t kMaxViewers = 192;  ///< without a place

  /// Fails when the port cannot be had, the certificate cannot be used, or one is missing.
  static Result<std::unique_ptr<WebServer>> open(const WebOptions& options, Site site, WebHandlers handlers);
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  [[nodiscard]] std::uint16_t port() const;
  /// As people type it.
  [[nodiscard]] std::string address() const;
  /// How long its certificate is valid; none without TLS.
  [[nodiscard]] std::optional<std::chrono::hours> certificateValidity() const;
  void start();
  /// Serves these channels at `path`, as roomOf() gives it; without effect when there is such a room.
  void addRoom(const std::string& path, std::vector<Channel> channels);
  /// Viewers that are there are disconnected.
  void removeRoom(const std::string& path);
  /// Hands messages to all viewers of the room that subscribe to their channels. One of channel 0: what late
  /// subscribers would get, and what viewers have yet to get, is forgotten. Waits while the server has not
  /// yet taken the last 64 calls.
  void publish(const std::string& path, std::vector<Publication> publications);
  /// Sends the desk's answer to one viewer, if it is still there; a role in it is a place.
  void answer(ViewerId viewer, DeskAnswer answer);
  /// Sends what its hands are shown to one viewer, if it is still there; the newest one wins.
  void show(ViewerId viewer, Payload views);
  /// Serves no more and calls no handler any more; also by the destructor.
  void stop();
  /// Connected viewers.
  [[nodiscard]] std::size_t viewers() const;

 private:
  explicit WebServer(std::unique_ptr<WebService> impl);
  std::unique_ptr<WebService> impl_;
};

}  // namespace tenon::console
