#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "clients/console/foxglove_protocol.h"

namespace tenon::console {

struct WebOptions {
  std::string address = "127.0.0.1";  ///< of the interface
  std::uint16_t port = 8080;          ///< 0: any that is free
  std::filesystem::path certificate;  ///< for TLS, as PEM, with its key; empty: without TLS
  std::filesystem::path key;
  bool is_plain_permitted = false;  ///< without TLS beyond the loopback interface, too
  std::vector<std::string>
      origins;  ///< pages from elsewhere that may connect, as in "https://viewer.example"
  std::vector<std::string> recordings_from;  ///< origins of servers from which the page may read recordings
  std::string name = "tenon";                ///< of the server, for viewers
  std::chrono::milliseconds send_timeout{20'000};  ///< in which a connection has to take something
  std::chrono::milliseconds heartbeat{2'000};      ///< from one heartbeat of the server's pages to the next
};

using ViewerId = std::uint64_t;  ///< of one connection; never used again

/// What the server tells its owner, in the server's thread; none may wait.
struct WebHandlers {
  std::function<void(const std::string& path)> entered;         ///< a viewer of this room
  std::function<void(ViewerId, const std::string& path)> left;  ///< of one that has entered
  /// A request to the desk, from a page of this server or a program, never from a page from elsewhere.
  std::function<void(ViewerId, const std::string& path, const DeskRequest&)> desk;
  /// Targets of the viewer's hands, likewise; false when they are none.
  std::function<bool(ViewerId, std::span<const std::uint8_t>)> hands;
  /// A sentence about what is kept of this room; may be empty.
  std::function<void(const std::string& path, const std::string& text)> told = nullptr;
};

}  // namespace tenon::console
