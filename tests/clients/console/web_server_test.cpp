#include "clients/console/web_server.h"

#include <chrono>
#include <filesystem>
#include <string>
#include <thread>

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

TEST(LoopbackAddress, IsOneThatThisMachineAloneReaches) {
  for (const char* address : {"127.0.0.1", "127.1.2.3", "::1", "0:0:0:0:0:0:0:1"})
    EXPECT_TRUE(isLoopbackAddress(address)) << address;
  for (const char* address : {"0.0.0.0", "::", "192.168.7.5", "fd00::5", "localhost", ""})
    EXPECT_FALSE(isLoopbackAddress(address)) << address;
}

}  // namespace
}  // namespace tenon::console
