#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <map>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "idl/wire/assets.h"

namespace tenon::test {

/// Serves ranges of assets on loopback, as the console does; a request at a time.
class RangeServer {
 public:
  explicit RangeServer(const std::vector<std::vector<std::uint8_t>>& assets) {
    for (const auto& asset : assets) assets_[wire::assetName(asset)] = asset;
    listener_ = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(bind(listener_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(listen(listener_, 8), 0);
    EXPECT_EQ(getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { serve(); });
  }
  ~RangeServer() {
    over_ = true;
    thread_.join();
    close(listener_);
  }
  [[nodiscard]] std::string url() const { return "http://127.0.0.1:" + std::to_string(port_); }

  std::atomic<std::size_t> most_bytes = SIZE_MAX;  ///< of an answer; then the connection ends
  std::atomic<bool> damages = false;
  std::atomic<std::size_t> sent = 0;  ///< [bytes] of content
  std::atomic<int> requests = 0;

 private:
  void serve() {
    while (!over_) {
      pollfd entry{listener_, POLLIN, 0};
      if (poll(&entry, 1, 20) <= 0) continue;
      const int connection = accept(listener_, nullptr, nullptr);
      answer(connection);
      close(connection);
    }
  }
  void answer(int connection) {
    std::string request;
    char buffer[4096];
    while (request.find("\r\n\r\n") == std::string::npos) {
      const ssize_t got = recv(connection, buffer, sizeof buffer, 0);
      if (got <= 0) return;
      request.append(buffer, static_cast<std::size_t>(got));
    }
    ++requests;
    std::size_t first = 0, last = 0;
    const std::size_t range = request.find("Range: bytes=");
    constexpr std::string_view kGet = "GET /assets/";
    const auto found =
        assets_.find(request.substr(kGet.size(), request.find(' ', kGet.size()) - kGet.size()));
    if (range == std::string::npos || !request.starts_with(kGet) || found == assets_.end() ||
        std::sscanf(request.c_str() + range, "Range: bytes=%zu-%zu", &first, &last) != 2)
      return put(connection, "HTTP/1.1 404 Not Found\r\n\r\n");
    const std::vector<std::uint8_t>& content = found->second;
    last = std::min(last, content.size() - 1);
    std::string text = "HTTP/1.1 206 Partial Content\r\nContent-Range: bytes " + std::to_string(first) + "-" +
                       std::to_string(last) + "/" + std::to_string(content.size()) + "\r\n\r\n";
    const std::size_t count = std::min(last + 1 - first, most_bytes.load());
    text.append(reinterpret_cast<const char*>(content.data()) + first, count);
    if (damages) text.back() = static_cast<char>(text.back() ^ 1);
    sent += count;
    put(connection, text);
  }
  static void put(int connection, const std::string& text) {
    for (std::size_t at = 0; at < text.size();) {
      const ssize_t count = send(connection, text.data() + at, text.size() - at, MSG_NOSIGNAL);
      if (count <= 0) return;
      at += static_cast<std::size_t>(count);
    }
  }

  std::map<std::string, std::vector<std::uint8_t>> assets_;  ///< by name
  int listener_ = -1;
  std::uint16_t port_ = 0;
  std::atomic<bool> over_ = false;
  std::thread thread_;
};

}  // namespace tenon::test
