#include "clients/console/gateway.h"

#include <array>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "idl/record/mcap_writer.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/session.h"
#include "idl/wire/endpoint.h"
#include "tests/idl/wire/peer.h"

namespace tenon::console {
namespace {

/// A viewer that enters a room and reads nothing.
class ViewerMock {
 public:
  ViewerMock(std::uint16_t port, const std::string& path) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return;
    const std::string request =
        "GET " + path +
        " HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
        "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n";
    if (write(socket_, request.data(), request.size()) < 0) return;
    std::string head;
    for (char next = 0; !head.ends_with("\r\n\r\n") && recv(socket_, &next, 1, 0) == 1;) head += next;
    std::array<std::uint8_t, 256> frame{};
    if (!head.starts_with("HTTP/1.1 101") || recv(socket_, frame.data(), 2, MSG_WAITALL) != 2) return;
    is_in_ = frame[0] != kClose;
    const std::size_t size = frame[1];
    if (is_in_ || size > frame.size()) return;
    if (recv(socket_, frame.data(), size, MSG_WAITALL) > 2)
      reason_.assign(frame.begin() + 2, frame.begin() + size);
  }
  ~ViewerMock() { close(socket_); }
  ViewerMock(const ViewerMock&) = delete;
  ViewerMock& operator=(const ViewerMock&) = delete;

  [[nodiscard]] bool isIn() const { return is_in_; }
  /// Why it was closed at once; empty: it is in the room, or there is no connection.
  [[nodiscard]] const std::string& reason() const { return reason_; }

 private:
  static constexpr std::uint8_t kClose = 0x88;
  int socket_ = socket(AF_INET, SOCK_STREAM, 0);
  bool is_in_ = false;
  std::string reason_;
};

/// A gateway for all sessions of a domain, and what announces sessions there.
class GatewayTest : public ::testing::Test {
 protected:
  GatewayTest() {
    options_.domain = test::ownDomain();
    options_.web.port = 0;
    options_.print = [this](const std::string& line) {
      std::smatch found;
      if (std::regex_match(line, found, std::regex("console: http://localhost:(\\d+)/")))
        port_ = static_cast<std::uint16_t>(std::stoi(found[1]));
      if (line.find("is not shown") != std::string::npos) ++not_shown_;
    };
    thread_ = std::thread([this] { result_ = runGateway(options_, stop_); });
    EXPECT_TRUE(until([this] { return port_ != 0; }));
    EXPECT_TRUE(inbox_.on<EmergencyStop>(any_, wire::kEmergencyStop, [](const EmergencyStop&) {}));
  }
  ~GatewayTest() override {
    stop_ = true;
    thread_.join();
    EXPECT_TRUE(result_) << result_.error().what;
  }
  bool until(const std::function<bool()>& done) { return test::dispatchUntil(inbox_, done); }
  bool isThere(const std::string& room) const { return ViewerMock(port_, room).isIn(); }
  bool isMissing(const std::string& room) const {
    return ViewerMock(port_, room).reason().starts_with("there is no such session");
  }
  void announce(const std::string& name) { EXPECT_TRUE(announce_.write({.session = name})); }

  std::shared_ptr<wire::Participant> bus_ = test::participant(test::ownDomain());
  wire::Partition lobby_{bus_, wire::kLobby};
  wire::Partition any_{bus_, wire::sessionPartition("a")};
  wire::Writer<SessionAnnounce> announce_ =
      std::move(*wire::Writer<SessionAnnounce>::open(lobby_, wire::kSessionAnnounce));
  wire::Inbox inbox_;
  GatewayOptions options_;
  std::atomic<std::uint16_t> port_{0};
  std::atomic<int> not_shown_{0};
  std::atomic<bool> stop_{false};
  Result<void> result_;
  std::thread thread_;
};

TEST_F(GatewayTest, WhoIsInTheLobbyFindsItsStopReady) {
  ASSERT_EQ(inbox_.matchedWriters(), 0U);
  const ViewerMock viewer(port_, "/lobby");
  ASSERT_TRUE(viewer.isIn());
  EXPECT_TRUE(until([this] { return inbox_.matchedWriters() > 0; }));
}

TEST_F(GatewayTest, ASessionThatHasEndedMakesPlaceWhenNobodyLooksAtIt) {
  constexpr int kMost = 64;
  for (int i = 0; i < kMost; ++i) announce(i == 0 ? "a" : "s" + std::to_string(i));
  ASSERT_TRUE(until([this] { return isThere("/live/s63"); }));
  announce("z");
  ASSERT_TRUE(until([this] { return not_shown_ > 0; })) << "the limit is said";
  EXPECT_TRUE(isMissing("/live/z"));
  auto viewer = std::make_unique<ViewerMock>(port_, "/live/a");
  ASSERT_TRUE(viewer->isIn());
  ASSERT_TRUE(until([this] { return inbox_.matchedWriters() > 0; })) << "its stop is ready";

  // of one that somebody looks at the room stays
  ASSERT_TRUE(announce_.dispose({.session = "a"}));
  ASSERT_TRUE(announce_.dispose({.session = "s1"}));
  EXPECT_TRUE(until([this] { return isThere("/live/z"); }));
  EXPECT_TRUE(isMissing("/live/s1"));
  EXPECT_TRUE(isThere("/live/a"));
  EXPECT_GT(inbox_.matchedWriters(), 0U);
  viewer.reset();
  EXPECT_TRUE(until([this] { return isMissing("/live/a"); }));
  EXPECT_TRUE(until([this] { return inbox_.matchedWriters() == 0; })) << "what raises its stop has ended";
}

/// A gateway for a recording.
class RecordingGatewayTest : public ::testing::Test {
 protected:
  RecordingGatewayTest() {
    options_.web.port = 0;
    options_.recording = file_;
  }
  ~RecordingGatewayTest() override { std::filesystem::remove(file_); }
  /// A recording of which the first byte of this content is wrong.
  void damage(const std::string& content) const {
    {
      auto writer = record::McapWriter::open(file_, {.compress = false});
      ASSERT_TRUE(writer);
      const auto channel = writer->addChannel("A", "tenon::A", "module tenon { struct A {}; };");
      ASSERT_TRUE(writer->write(channel, 1, 1, std::vector<std::uint8_t>{'m', 'a', 'r', 'k'}));
      ASSERT_TRUE(writer->addAttachment("a", "text/plain", std::vector<std::uint8_t>{'n', 'o', 't', 'e'}));
      ASSERT_TRUE(writer->close());
    }
    std::fstream bytes(file_, std::ios::in | std::ios::out | std::ios::binary);
    const std::string whole{std::istreambuf_iterator<char>(bytes), {}};
    bytes.seekp(static_cast<std::streamoff>(whole.find(content)));
    bytes.put('b');
  }

  const std::filesystem::path file_ =
      std::filesystem::temp_directory_path() / ("gateway_" + std::to_string(getpid()) + ".mcap");
  GatewayOptions options_;
  std::atomic<bool> stop_{false};
};

TEST_F(RecordingGatewayTest, RefusesAPipeInsteadOfWaitingForIt) {
  ASSERT_EQ(mkfifo(file_.c_str(), 0600), 0);
  const auto served = runGateway(options_, stop_);
  ASSERT_FALSE(served);
  EXPECT_NE(served.error().what.find(file_.string()), std::string::npos) << served.error().what;
}

TEST_F(RecordingGatewayTest, RefusesADamagedChunkAndSaysWhatReadsTheRest) {
  damage("mark");
  const auto served = runGateway(options_, stop_);
  ASSERT_FALSE(served);
  EXPECT_NE(served.error().what.find("1 of its 1 chunks are damaged"), std::string::npos);
  EXPECT_NE(served.error().what.find("`tenon report"), std::string::npos);
}

TEST_F(RecordingGatewayTest, SaysThatAnAttachmentIsDamagedAndServesIt) {
  damage("note");
  std::vector<std::string> lines;
  options_.print = [&](const std::string& line) {
    lines.push_back(line);
    if (line.starts_with("console: ")) stop_ = true;
  };
  ASSERT_TRUE(runGateway(options_, stop_));
  ASSERT_FALSE(lines.empty());
  EXPECT_TRUE(lines[0].starts_with("warning: ")) << lines[0];
  EXPECT_NE(lines[0].find("an attachment"), std::string::npos);
}

TEST_F(RecordingGatewayTest, SaysHowFarALongCheckIsBeforeItsAddress) {
  damage("note");
  std::vector<std::string> lines;
  options_.progress_period = {};
  options_.progress = [&](const std::string& line) { lines.push_back(line); };
  options_.print = [&](const std::string& line) {
    lines.push_back(line);
    if (line.starts_with("console: ")) stop_ = true;
  };
  ASSERT_TRUE(runGateway(options_, stop_));
  ASSERT_FALSE(lines.empty());
  EXPECT_TRUE(std::regex_match(lines[0], std::regex(file_.string() + ": checking that it is whole, \\d+ %")))
      << lines[0];
}

}  // namespace
}  // namespace tenon::console
