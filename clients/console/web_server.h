#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "clients/console/channel.h"
#include "clients/console/site.h"
#include "idl/types/result.h"

namespace tenon::console {

struct WebOptions {
  std::uint16_t port = 8080;  ///< on 127.0.0.1; 0: any that is free
  std::vector<std::string>
      origins;                 ///< pages from elsewhere that may connect, as in "https://viewer.example"
  std::string name = "tenon";  ///< of the server, for viewers
};

/// The HTTP and WebSocket server of the gateway, on the loopback interface.
///
/// HTTP: a Site. WebSocket, at any path: the Foxglove protocol. A viewer has a ViewerQueue; one that takes
/// nothing for 20 s, sends more than 200 messages a second, or messages longer than 64 kB, is disconnected.
/// At most 256 connections are served. A request must name a loopback host, and a WebSocket one a permitted
/// origin.
///
/// Threads: open, start and stop from one thread; it has a thread of its own, which alone serves. publish
/// from one thread. Real-time: no.
class WebServer {
 public:
  /// Fails when the port cannot be had.
  static Result<std::unique_ptr<WebServer>> open(const WebOptions& options, Site site,
                                                 std::vector<Channel> channels);
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  [[nodiscard]] std::uint16_t port() const;
  void start();
  /// Hands messages to all viewers that subscribe to their channels. One of channel 0: what late subscribers
  /// would get is forgotten. Waits while the server has not yet taken the last 64 calls.
  void publish(std::vector<Publication> publications);
  /// Closes all connections; also by the destructor.
  void stop();
  /// Connected viewers.
  [[nodiscard]] std::size_t viewers() const;

 private:
  struct Impl;
  explicit WebServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tenon::console
