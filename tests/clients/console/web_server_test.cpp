#include "clients/console/web_server.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

namespace tenon::console {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

constexpr std::size_t kFile = 8U << 20U;  // [bytes] more than the buffers of a connection
constexpr milliseconds kPermitted{400};

/// A server of one large file.
class WebServerTest : public testing::Test {
 protected:
  WebServerTest() {
    fs::create_directories(folder_);
    FILE* const file = fopen((folder_ / "a.mcap").c_str(), "w");
    fclose(file);
    fs::resize_file(folder_ / "a.mcap", kFile);
    Site site(folder_ / "none", wire::AssetStore(folder_));
    EXPECT_TRUE(site.serveRecording(folder_ / "a.mcap"));
    server_ = WebServer::open({.port = 0, .send_timeout = kPermitted}, std::move(site), {}).value();
    server_->start();
  }
  ~WebServerTest() override {
    server_->stop();
    fs::remove_all(folder_);
  }

  /// A connection that has asked for the file; `headers`: lines with their ends.
  int ask(const std::string& method, const std::string& headers = {}) const {
    const int connection = socket(AF_INET, SOCK_STREAM, 0);
    const int buffer = 64 << 10;
    setsockopt(connection, SOL_SOCKET, SO_RCVBUF, &buffer, sizeof buffer);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(server_->port());
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(connect(connection, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    const std::string request =
        method + " /recording.mcap HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" + headers + "\r\n";
    EXPECT_EQ(write(connection, request.data(), request.size()), static_cast<ssize_t>(request.size()));
    return connection;
  }
  /// All that comes until its end, with a pause after each so many bytes.
  static std::string take(int connection, std::size_t piece = kFile, milliseconds pause = milliseconds(0)) {
    std::string all, bytes(64U << 10U, '\0');
    std::size_t rested = 0;
    for (ssize_t got; (got = recv(connection, bytes.data(), bytes.size(), 0)) > 0;) {
      all.append(bytes, 0, static_cast<std::size_t>(got));
      if (all.size() - rested < piece) continue;
      rested = all.size();
      std::this_thread::sleep_for(pause);
    }
    close(connection);
    return all;
  }

  const fs::path folder_ = fs::temp_directory_path() / ("tenon_web_server_test_" + std::to_string(getpid()));
  std::unique_ptr<WebServer> server_;
};

TEST_F(WebServerTest, ADownloadThatGoesOnTakesAsLongAsItNeeds) {
  const auto began = std::chrono::steady_clock::now();
  const std::string answer = take(ask("GET"), kFile / 10, kPermitted / 4);
  EXPECT_GT(std::chrono::steady_clock::now() - began, 2 * kPermitted) << "it shows nothing then";
  EXPECT_EQ(answer.size() - (answer.find("\r\n\r\n") + 4), kFile);
}

TEST_F(WebServerTest, ADownloadThatStandsStillEnds) {
  const int connection = ask("GET");
  // longer than is permitted: the server ends it, and what waits in buffers is all that comes
  std::this_thread::sleep_for(3 * kPermitted);
  EXPECT_LT(take(connection).size(), kFile);
}

/// How often this process has `file` open.
std::ptrdiff_t openings(const fs::path& file) {
  const fs::directory_iterator descriptors("/proc/self/fd");
  return std::count_if(fs::begin(descriptors), fs::end(descriptors), [&](const fs::directory_entry& one) {
    std::error_code ignored;
    return fs::read_symlink(one.path(), ignored) == file;
  });
}

TEST_F(WebServerTest, WhatAPageHasLeftInTheMiddleIsReadNoFarther) {
  server_->stop();
  Site site(folder_ / "none", wire::AssetStore(folder_));
  ASSERT_TRUE(site.serveRecording(folder_ / "a.mcap"));
  // what is left ends by being left, not for standing still
  server_ =
      WebServer::open({.port = 0, .send_timeout = std::chrono::minutes(10)}, std::move(site), {}).value();
  server_->start();
  std::vector<int> pages;
  for (int i = 0; i < 5; ++i) {
    pages.push_back(ask("GET"));
    char first = 0;
    ASSERT_EQ(recv(pages.back(), &first, 1, 0), 1);
  }
  const std::ptrdiff_t while_read = openings(folder_ / "a.mcap");
  EXPECT_GE(while_read, 5);
  for (const int page : pages) close(page);
  for (int i = 0; i < 6000 && openings(folder_ / "a.mcap") > while_read - 5; ++i)
    std::this_thread::sleep_for(milliseconds(10));
  EXPECT_EQ(openings(folder_ / "a.mcap"), while_read - 5);
}

TEST_F(WebServerTest, HeadSaysTheSizeAndSendsNothingOfIt) {
  const std::string answer = take(ask("HEAD"));
  EXPECT_NE(answer.find("Content-Length: " + std::to_string(kFile) + "\r\n"), std::string::npos) << answer;
  EXPECT_TRUE(answer.ends_with("\r\n\r\n"));
}

TEST_F(WebServerTest, ADownloadThatWasCutGoesOnWhereItEnded) {
  const std::string rest = take(ask("GET", "Range: bytes=" + std::to_string(kFile - 3) + "-\r\n"));
  EXPECT_TRUE(rest.starts_with("HTTP/1.1 206 ")) << rest;
  EXPECT_NE(rest.find("Content-Range: bytes 8388605-8388607/8388608\r\n"), std::string::npos) << rest;
  EXPECT_TRUE(rest.ends_with("\r\n\r\n" + std::string(3, '\0')));
  const std::string none = take(ask("GET", "Range: bytes=" + std::to_string(kFile) + "-\r\n"));
  EXPECT_TRUE(none.starts_with("HTTP/1.1 416 ")) << none;
  EXPECT_NE(none.find("Content-Range: bytes */8388608\r\n"), std::string::npos) << none;
}

TEST_F(WebServerTest, SendsAllWhenARangeIsAskedForOnCondition) {
  const std::string answer = take(ask("GET", "Range: bytes=5-\r\nIf-Range: \"a\"\r\n"));
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 "));
  EXPECT_EQ(answer.size() - (answer.find("\r\n\r\n") + 4), kFile);
}

/// [bytes] that the kernel keeps unread for a client of these tests, whatever the machine's settings are.
constexpr int kReceiveBuffer = 256 << 10;

/// A connection from an address of the loopback interface, which stands for another machine.
int connectFrom(const char* own, std::uint16_t port) {
  const int connection = socket(AF_INET, SOCK_STREAM, 0);
  setsockopt(connection, SOL_SOCKET, SO_RCVBUF, &kReceiveBuffer, sizeof kReceiveBuffer);
  const timeval patience{10, 0};
  setsockopt(connection, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  inet_pton(AF_INET, own, &address.sin_addr);
  EXPECT_EQ(bind(connection, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(connect(connection, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  return connection;
}

std::string statusFrom(const char* own, std::uint16_t port) {
  const int connection = connectFrom(own, port);
  const std::string request = "HEAD /recording.mcap HTTP/1.1\r\nHost: localhost\r\n\r\n";
  EXPECT_EQ(write(connection, request.data(), request.size()), static_cast<ssize_t>(request.size()));
  std::string status(sizeof "HTTP/1.1 200" - 1, '\0');
  status.resize(static_cast<std::size_t>(
      std::max<ssize_t>(0, recv(connection, status.data(), status.size(), MSG_WAITALL))));
  close(connection);
  return status;
}

/// Somebody who looks on.
class OnlookerMock {
 public:
  /// `headers`: lines with their ends.
  OnlookerMock(const char* own, std::uint16_t port, const std::string& headers = {},
               const std::string& room = "/live")
      : socket_(connectFrom(own, port)) {
    const std::string request =
        "GET " + room +
        " HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
        "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n" +
        headers + "\r\n";
    EXPECT_EQ(write(socket_, request.data(), request.size()), static_cast<ssize_t>(request.size()));
    std::string head;
    while (!head.ends_with("\r\n\r\n")) {
      const std::string next = bytes(1);
      if (next.empty()) break;
      head += next;
    }
    EXPECT_TRUE(head.starts_with("HTTP/1.1 101 ")) << head;
    first_ = text();
  }
  ~OnlookerMock() { close(socket_); }
  OnlookerMock(const OnlookerMock&) = delete;
  OnlookerMock& operator=(const OnlookerMock&) = delete;

  /// What came first: of one that has entered its room, the server's info.
  [[nodiscard]] const std::string& first() const { return first_; }
  void send(const std::string& request) const {
    const std::string mask(4, '\0');
    const std::string frame{"\x81" + std::string(1, static_cast<char>(0x80 | request.size())) + mask +
                            request};
    EXPECT_EQ(write(socket_, frame.data(), frame.size()), static_cast<ssize_t>(frame.size()));
  }
  /// Asks the desk for a seat; the answer.
  std::string sit() {
    send(R"({"op":"deskSit","id":7,"role":"instructor","name":"","key":""})");
    for (std::string answer; !(answer = text()).empty();)
      if (answer.find("deskAnswer") != std::string::npos) return answer;
    return {};
  }
  /// The next message or, of its end, the reason; empty: nothing came.
  std::string text() {
    std::string head = bytes(2);
    if (head.empty()) return {};
    std::size_t size = static_cast<std::uint8_t>(head[1]);
    if (size >= 126) {
      const std::string length = bytes(size == 126 ? 2 : 8);
      size = 0;
      for (const char digit : length) size = size << 8U | static_cast<std::uint8_t>(digit);
    }
    const std::string content = bytes(size);
    const bool is_end = (static_cast<std::uint8_t>(head[0]) & 0x0fU) == 8U;
    return is_end && content.size() > 2 ? content.substr(2) : content;
  }

 private:
  std::string bytes(std::size_t size) const {
    std::string all(size, '\0');
    const ssize_t got = recv(socket_, all.data(), size, MSG_WAITALL);
    return got == static_cast<ssize_t>(size) ? all : std::string();
  }

  int socket_;
  std::string first_;
};

/// A server that gives a seat to whoever asks.
class CrowdedWebServerTest : public testing::Test {
 protected:
  CrowdedWebServerTest() {
    fs::create_directories(folder_);
    std::ofstream(folder_ / "a.mcap") << "recording";
    fs::resize_file(folder_ / "a.mcap", kFile);
    Site site(folder_ / "none", wire::AssetStore(folder_));
    EXPECT_TRUE(site.serveRecording(folder_ / "a.mcap"));
    WebHandlers handlers;
    handlers.desk = [this](ViewerId viewer, const std::string&, const DeskRequest& request) {
      server_->answer(viewer, {.id = request.id, .accepted = true, .role = request.role});
    };
    server_ =
        WebServer::open({.port = 0, .heartbeat = milliseconds(50)}, std::move(site), std::move(handlers))
            .value();
    server_->addRoom(std::string(kFirstRoom), {{.id = 1, .topic = "events", .delivery = Delivery::kEach}});
    server_->start();
  }
  ~CrowdedWebServerTest() override {
    server_->stop();
    fs::remove_all(folder_);
  }

  const fs::path folder_ = fs::temp_directory_path() / ("tenon_crowd_test_" + std::to_string(getpid()));
  std::unique_ptr<WebServer> server_;
};

TEST_F(CrowdedWebServerTest, ManyViewersOfOneMachineKeepNobodyOut) {
  OnlookerMock seated("127.0.0.2", server_->port()), alone("127.0.0.3", server_->port());
  EXPECT_NE(seated.sit().find(R"("role":"instructor")"), std::string::npos);
  std::vector<std::unique_ptr<OnlookerMock>> many;
  for (std::size_t i = 0; i < WebServer::kMaxViewers; ++i)
    many.push_back(std::make_unique<OnlookerMock>("127.0.0.2", server_->port()));
  OnlookerMock newcomer("127.0.0.1", server_->port());
  for (const std::size_t oldest : {0U, 1U}) {
    EXPECT_NE(many[oldest]->text().find("advertise"), std::string::npos);
    EXPECT_EQ(many[oldest]->text(), "a newer viewer came: 192 look on here at most, without a seat or hands");
  }
  EXPECT_EQ(statusFrom("127.0.0.1", server_->port()), "HTTP/1.1 200");
  // who else is there stays, and may sit down
  for (OnlookerMock* const viewer : {many[2].get(), &seated, &alone, &newcomer})
    EXPECT_NE(viewer->sit().find(R"("role":"instructor")"), std::string::npos);
}

TEST_F(CrowdedWebServerTest, DownloadsThatNobodyReadsKeepNobodyOut) {
  const std::string request = "GET /recording.mcap HTTP/1.1\r\nHost: localhost\r\n\r\n";
  std::vector<int> downloads;
  for (std::size_t i = 0; i < WebServer::kMaxConnections; ++i) {
    downloads.push_back(connectFrom("127.0.0.2", server_->port()));
    ASSERT_EQ(write(downloads.back(), request.data(), request.size()), static_cast<ssize_t>(request.size()));
    char first = 0;
    ASSERT_EQ(recv(downloads.back(), &first, 1, 0), 1) << i;
  }
  for (const char* own : {"127.0.0.1", "127.0.0.2"})
    EXPECT_EQ(statusFrom(own, server_->port()), "HTTP/1.1 200");
  for (const int download : downloads) close(download);
}

TEST_F(CrowdedWebServerTest, TellsWhoAsksForARoomThatIsNotThereByTheReasonOfTheClose) {
  OnlookerMock late("127.0.0.1", server_->port(), {}, "/live/gone");
  EXPECT_EQ(late.first(),
            "there is no such session: it has ended or not begun, or this gateway shows too many");
}

TEST_F(CrowdedWebServerTest, PagesOfThisServerAloneGetAHeartbeat) {
  OnlookerMock program("127.0.0.1", server_->port());
  OnlookerMock page("127.0.0.1", server_->port(), "Origin: http://localhost\r\n");
  EXPECT_NE(page.first().find("serverInfo"), std::string::npos);
  EXPECT_NE(page.text().find("advertise"), std::string::npos);
  for (int beat = 0; beat < 3; ++beat) EXPECT_EQ(page.text(), R"({"op":"heartbeat"})");
  EXPECT_NE(program.text().find("advertise"), std::string::npos);
  program.send(R"({"op":"deskSit","id":7,"role":"instructor","name":"","key":""})");
  EXPECT_NE(program.text().find("deskAnswer"), std::string::npos) << "and no heartbeat before";
}

TEST_F(CrowdedWebServerTest, NothingOfAFormerSessionComesOnceTheNextOneHasBegun) {
  constexpr int kOld = 2'000;
  constexpr std::size_t kSize = 64U << 10U;  // [bytes] all of them are more than sockets keep
  OnlookerMock slow("127.0.0.1", server_->port());
  EXPECT_NE(slow.text().find("advertise"), std::string::npos);
  slow.send(R"({"op":"subscribe","subscriptions":[{"id":5,"channelId":1}]})");
  EXPECT_NE(slow.sit().find("deskAnswer"), std::string::npos) << "it has subscribed";
  const auto event = [&](char content) {
    return Publication{.channel = 1,
                       .payload = std::make_shared<const std::vector<std::uint8_t>>(kSize, content)};
  };
  server_->publish(std::string(kFirstRoom), std::vector<Publication>(kOld, event('o')));
  server_->publish(std::string(kFirstRoom), {Publication{}, event('n')});
  int old = 0;
  std::string message = slow.text();
  for (; !message.empty() && message.back() == 'o'; message = slow.text()) ++old;
  ASSERT_FALSE(message.empty());
  EXPECT_EQ(message.back(), 'n');
  EXPECT_LT(old, kOld / 2) << "those that were on their way alone";
}

/// [bytes] of memory that this process has now.
std::size_t memoryNow() {
  std::size_t all = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> all >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

TEST_F(CrowdedWebServerTest, AnAssetIsReadWhileItIsSentHoweverManyAskForIt) {
  constexpr std::size_t kSize = 32U << 20U, kReaders = 24;
  const wire::AssetStore assets(folder_);
  const std::string name = assets.put(std::vector<std::uint8_t>(kSize, 7)).value();
  const auto ask = [&] {
    const int connection = connectFrom("127.0.0.2", server_->port());
    const std::string request =
        "GET /assets/" + name + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    EXPECT_EQ(write(connection, request.data(), request.size()), static_cast<ssize_t>(request.size()));
    char first = 0;
    EXPECT_EQ(recv(connection, &first, 1, 0), 1);
    return connection;
  };
  std::string piece(1U << 20U, '\0');
  std::size_t size = 1;
  const int whole = ask();
  for (ssize_t got; (got = recv(whole, piece.data(), piece.size(), 0)) > 0;)
    size += static_cast<std::size_t>(got);
  close(whole);
  EXPECT_GT(size, kSize);

  const std::size_t before = memoryNow();
  std::vector<int> slow;
  for (std::size_t i = 0; i < kReaders; ++i) slow.push_back(ask());
  EXPECT_LT(memoryNow(), before + kReaders * kSize / 4);
  for (const int connection : slow) close(connection);

  // of a damaged one nothing is sent
  std::fstream(assets.fileOf(name), std::ios::in | std::ios::out) << "x";
  const int damaged = ask();
  std::string answer(11, '\0');
  EXPECT_EQ(recv(damaged, answer.data(), answer.size(), MSG_WAITALL), static_cast<ssize_t>(answer.size()));
  EXPECT_EQ(answer, "TTP/1.1 404");
  close(damaged);
}

TEST(LoopbackAddress, IsOneThatThisMachineAloneReaches) {
  for (const char* address : {"127.0.0.1", "127.1.2.3", "::1", "0:0:0:0:0:0:0:1"})
    EXPECT_TRUE(isLoopbackAddress(address)) << address;
  for (const char* address : {"0.0.0.0", "::", "192.168.7.5", "fd00::5", "localhost", ""})
    EXPECT_FALSE(isLoopbackAddress(address)) << address;
}

}  // namespace
}  // namespace tenon::console
