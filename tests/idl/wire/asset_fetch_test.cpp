#include "idl/wire/asset_fetch.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace tenon::wire {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// Serves ranges of one file on loopback, as the console does; a request at a time.
class RangeServer {
 public:
  explicit RangeServer(std::vector<std::uint8_t> content) : content_(std::move(content)) {
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
    if (range == std::string::npos || !request.starts_with("GET /assets/") ||
        std::sscanf(request.c_str() + range, "Range: bytes=%zu-%zu", &first, &last) != 2)
      return put(connection, "HTTP/1.1 404 Not Found\r\n\r\n");
    last = std::min(last, content_.size() - 1);
    std::string text = "HTTP/1.1 206 Partial Content\r\nContent-Range: bytes " + std::to_string(first) + "-" +
                       std::to_string(last) + "/" + std::to_string(content_.size()) + "\r\n\r\n";
    const std::size_t count = std::min(last + 1 - first, most_bytes.load());
    text.append(reinterpret_cast<const char*>(content_.data()) + first, count);
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

  std::vector<std::uint8_t> content_;
  int listener_ = -1;
  std::uint16_t port_ = 0;
  std::atomic<bool> over_ = false;
  std::thread thread_;
};

std::vector<std::uint8_t> content() {
  std::vector<std::uint8_t> bytes(std::size_t{40} << 20U);  // more than two ranges
  std::uint32_t number = 1;
  for (std::uint8_t& byte : bytes)
    byte = static_cast<std::uint8_t>((number = number * 1664525U + 1013904223U) >> 24U);
  return bytes;
}

class AssetFetchTest : public testing::Test {
 protected:
  ~AssetFetchTest() override { fs::remove_all(folder_); }
  const fs::path folder_ = fs::temp_directory_path() / ("tenon_fetch_test_" + std::to_string(getpid()));
  const AssetStore store_{folder_};
  const std::vector<std::uint8_t> bytes_ = content();
  const std::string name_ = assetName(bytes_);
  const std::atomic<bool> stop_ = false;
};

TEST_F(AssetFetchTest, FetchesOnceSaysHowFarAndKeepsIt) {
  RangeServer server(bytes_);
  std::uint64_t last = 0;
  const auto fetched = fetchAsset(
      store_, name_, server.url(),
      [&](std::uint64_t there, std::uint64_t of) {
        EXPECT_EQ(of, bytes_.size());
        EXPECT_GE(there, last);
        last = there;
      },
      stop_);
  ASSERT_TRUE(fetched) << fetched.error().what;
  EXPECT_EQ(*fetched, bytes_);
  EXPECT_EQ(last, bytes_.size());
  EXPECT_EQ(server.requests, 3);
  EXPECT_EQ(fetchAsset(store_, name_, server.url(), {}, stop_).value(), bytes_);
  EXPECT_EQ(server.requests, 3);
  EXPECT_EQ(fetchAsset(store_, name_, "", {}, stop_).value(), bytes_);
}

TEST_F(AssetFetchTest, GoesOnWhereItWasInterrupted) {
  RangeServer server(bytes_);
  server.most_bytes = 10U << 20U;
  const std::atomic<bool> stop = false;
  // the connection ends again and again, and so does the program
  std::atomic<bool> stopped = false;
  const auto first = fetchAsset(
      store_, name_, server.url(),
      [&](std::uint64_t there, std::uint64_t) { stopped = there >= (std::size_t{15} << 20U); }, stopped);
  EXPECT_FALSE(first);
  ASSERT_TRUE(fs::exists(folder_ / (name_ + ".part")));
  const auto second = fetchAsset(store_, name_, server.url(), {}, stop);
  ASSERT_TRUE(second) << second.error().what;
  EXPECT_EQ(*second, bytes_);
  EXPECT_LT(server.sent, bytes_.size() + (std::size_t{12} << 20U));
  EXPECT_FALSE(fs::exists(folder_ / (name_ + ".part")));
}

TEST_F(AssetFetchTest, OfProgramsThatShareAFolderOneFetches) {
  RangeServer server(bytes_);
  std::vector<std::vector<std::uint8_t>> got(4);
  std::vector<std::thread> programs;
  for (auto& mine : got)
    programs.emplace_back([&] {
      const auto fetched = fetchAsset(store_, name_, server.url(), {}, stop_);
      if (fetched) mine = *fetched;
    });
  for (std::thread& program : programs) program.join();
  for (const auto& mine : got) EXPECT_EQ(mine, bytes_);
  EXPECT_EQ(server.requests, 3);
}

TEST_F(AssetFetchTest, WhatHasAnotherHashIsRefusedAndNotKept) {
  RangeServer server(bytes_);
  server.damages = true;
  const auto fetched = fetchAsset(store_, name_, server.url(), {}, stop_);
  ASSERT_FALSE(fetched);
  EXPECT_THAT(fetched.error().what, HasSubstr("another hash"));
  EXPECT_FALSE(store_.has(name_));
  server.damages = false;
  EXPECT_TRUE(fetchAsset(store_, name_, server.url(), {}, stop_));
}

TEST_F(AssetFetchTest, WhatIsNotThereIsASentence) {
  EXPECT_THAT(fetchAsset(store_, name_, "", {}, stop_).error().what, HasSubstr(name_));
  EXPECT_THAT(fetchAsset(store_, name_, "ftp://there", {}, stop_).error().what,
              HasSubstr("expected http://"));
  std::string nobody;
  {
    const RangeServer gone(bytes_);
    nobody = gone.url();
  }
  EXPECT_THAT(fetchAsset(store_, name_, nobody, {}, stop_).error().what, HasSubstr("does not answer"));
  EXPECT_FALSE(fetchAsset(store_, "../../etc/passwd", "http://127.0.0.1:1", {}, stop_));
}

}  // namespace
}  // namespace tenon::wire
