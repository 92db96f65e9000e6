#include "devices/drivers/remote_device.h"

#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "tests/support/realtime_guard.h"

namespace tenon::devices {
namespace {

using testing::HasSubstr;

std::string freshPath() {
  static int count = 0;
  const auto file = std::filesystem::temp_directory_path() /
                    ("tenon-remote-" + std::to_string(getpid()) + "-" + std::to_string(++count));
  return file.string();
}

/// The program at the other end.
class RemotePeer {
 public:
  explicit RemotePeer(const std::string& path) : socket_(socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0)) {
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    std::memcpy(name.sun_path, path.data(), path.size());
    connected_ = connect(socket_, reinterpret_cast<const sockaddr*>(&name), sizeof name) == 0;
  }
  ~RemotePeer() { close(socket_); }
  RemotePeer(const RemotePeer&) = delete;
  RemotePeer& operator=(const RemotePeer&) = delete;

  void send(const Vector3& p, std::uint32_t buttons = kRemoteHeld) {
    std::array<std::uint8_t, kRemoteTargetSize> bytes{};
    const std::array<std::uint32_t, 4> words{kRemoteMagic, kRemoteVersion | 1U << 16U, ++seq_, buttons};
    const std::array<double, 8> numbers{p.x(), p.y(), p.z(), 1.0, 0.0, 0.0, 0.0, 0.5};
    std::memcpy(bytes.data(), words.data(), sizeof words);
    std::memcpy(bytes.data() + sizeof words, numbers.data(), sizeof numbers);
    sendRaw(bytes);
  }
  void sendRaw(std::span<const std::uint8_t> bytes) {
    EXPECT_EQ(::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL), static_cast<ssize_t>(bytes.size()));
  }
  /// Number of views received; none when nothing waits, nothing when the device has closed.
  std::optional<int> takeViews() {
    std::array<std::uint8_t, 512> bytes{};
    for (int count = 0;; ++count) {
      const ssize_t size = recv(socket_, bytes.data(), bytes.size(), 0);
      if (size == 0) return std::nullopt;
      if (size < 0) return errno == EAGAIN ? std::optional(count) : std::nullopt;
      EXPECT_EQ(size, static_cast<ssize_t>(kRemoteViewSize));
      std::memcpy(&newest, bytes.data() + 24, sizeof newest);
    }
  }
  [[nodiscard]] bool connected() const { return connected_; }

  std::array<double, 3> newest{};  // place of the hand

 private:
  int socket_;
  bool connected_ = false;
  std::uint32_t seq_ = 0;
};

class RemoteDeviceTest : public testing::Test {
 protected:
  DeviceState cycles(int count) {
    DeviceState state;
    for (int i = 0; i < count; ++i) {
      device_->read(state);
      device_->write({});
    }
    return state;
  }

  std::string path_ = freshPath();
  std::unique_ptr<RemoteDevice> device_ = std::move(*RemoteDevice::open(path_));
};

TEST_F(RemoteDeviceTest, ItsSocketIsTheUsersAlone) {
  struct stat status {};
  ASSERT_EQ(stat(path_.c_str(), &status), 0);
  EXPECT_TRUE(S_ISSOCK(status.st_mode));
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
  device_.reset();
  EXPECT_NE(stat(path_.c_str(), &status), 0) << "it is removed";
}

TEST_F(RemoteDeviceTest, FollowsItsPeerAtABoundedSpeedAndShowsIt) {
  RemotePeer peer(path_);
  Vector3 before = cycles(1).X_DH.translation();
  for (int i = 0; i < 1000; ++i) {
    peer.send(Vector3(0.2, 0.0, 0.1));
    const DeviceState state = cycles(1);
    EXPECT_LE((state.X_DH.translation() - before).norm(), 0.8e-3 + 1e-12);
    EXPECT_EQ(state.buttons, kRemoteHeld);
    before = state.X_DH.translation();
    ASSERT_EQ(peer.takeViews().value_or(-1), i == 0 ? 2 : 1) << "a view in each cycle";
  }
  EXPECT_LT((before - Vector3(0.2, 0.0, 0.1)).norm(), 1e-6);
  EXPECT_EQ(peer.newest[0], before.x());
  const DeviceState state = cycles(1);
  EXPECT_EQ(state.grip, 0.5);
  EXPECT_NE(state.stamp, 0);
}

TEST_F(RemoteDeviceTest, ASilentPeerHasReleasedTheDeadMansSwitchAndMakesRoomLater) {
  RemotePeer peer(path_);
  peer.send(Vector3(1.0, 0.0, 0.0));
  EXPECT_EQ(cycles(50).buttons, kRemoteHeld);
  const DeviceState aged = cycles(RemoteDevice::kSilent);
  EXPECT_EQ(aged.buttons & device_->caps().dead_man, 0U);
  EXPECT_EQ(cycles(10).X_DH.translation(), aged.X_DH.translation()) << "it stands still";
  peer.send(aged.X_DH.translation());
  EXPECT_EQ(cycles(1).buttons, kRemoteHeld) << "it is back";
  cycles(RemoteDevice::kGone + 1);
  EXPECT_FALSE(device_->connected());
  peer.takeViews();
  EXPECT_FALSE(peer.takeViews()) << "closed";
  RemotePeer next(path_);
  cycles(1);
  EXPECT_TRUE(device_->connected());
}

TEST_F(RemoteDeviceTest, AnArmingButtonThatWasHeldOverASilenceIsNotPressed) {
  constexpr std::uint32_t kBoth = kRemoteHeld | kRemoteArm;
  auto peer = std::make_unique<RemotePeer>(path_);
  const auto buttonsAfter = [&](std::uint32_t buttons) {
    peer->send(Vector3::Zero(), buttons);
    return cycles(1).buttons;
  };
  buttonsAfter(kRemoteHeld);
  EXPECT_EQ(buttonsAfter(kBoth), kBoth);
  cycles(RemoteDevice::kSilent);
  EXPECT_EQ(buttonsAfter(kBoth), kRemoteHeld) << "nobody saw it go up";
  EXPECT_EQ(buttonsAfter(kBoth), kRemoteHeld);
  EXPECT_EQ(buttonsAfter(kRemoteHeld), kRemoteHeld);
  EXPECT_EQ(buttonsAfter(kBoth), kBoth);
  peer.reset();
  cycles(2);
  peer = std::make_unique<RemotePeer>(path_);
  EXPECT_EQ(buttonsAfter(kBoth), kRemoteHeld) << "likewise after a new connection";
}

// it connects while the station starts, before the device is read for the first time
TEST_F(RemoteDeviceTest, AnArmingButtonThatIsDownFromTheFirstMessageIsNotPressed) {
  constexpr std::uint32_t kBoth = kRemoteHeld | kRemoteArm;
  RemotePeer peer(path_);
  for (const std::uint32_t buttons : {kBoth, kBoth}) {
    peer.send(Vector3::Zero(), buttons);
    EXPECT_EQ(cycles(1).buttons, kRemoteHeld);
  }
  peer.send(Vector3::Zero());
  EXPECT_EQ(cycles(1).buttons, kRemoteHeld);
  peer.send(Vector3::Zero(), kBoth);
  EXPECT_EQ(cycles(1).buttons, kBoth);
}

// no cycle in between is without a peer
TEST_F(RemoteDeviceTest, AnArmingButtonThatWasUpWithThePeerBeforeIsNotPressedByTheNextOne) {
  auto first = std::make_unique<RemotePeer>(path_);
  first->send(Vector3::Zero());
  DeviceState state;
  device_->read(state);
  EXPECT_EQ(state.buttons, kRemoteHeld);
  first.reset();
  device_->write({});
  RemotePeer next(path_);
  next.send(Vector3::Zero(), kRemoteHeld | kRemoteArm);
  EXPECT_EQ(cycles(1).buttons, kRemoteHeld);
}

TEST_F(RemoteDeviceTest, HasOnePeerAtATimeAndTheNextOneComesWhereTheHandIs) {
  auto first = std::make_unique<RemotePeer>(path_);
  first->send(Vector3(0.1, 0.0, 0.0));
  cycles(100);
  RemotePeer second(path_);
  cycles(1);
  EXPECT_FALSE(second.takeViews()) << "closed at once";
  first->send(Vector3(0.1, 0.0, 0.0));
  EXPECT_EQ(cycles(1).buttons, kRemoteHeld) << "the first one is not disturbed";
  first.reset();
  const Vector3 left = cycles(2).X_DH.translation();
  EXPECT_FALSE(device_->connected());
  EXPECT_EQ(cycles(1).buttons, 0U);
  RemotePeer third(path_);
  EXPECT_EQ(cycles(5).X_DH.translation(), left);
  EXPECT_TRUE(device_->connected());
}

TEST_F(RemoteDeviceTest, AMessageThatCannotBeUnderstoodEndsTheConnection) {
  for (const std::size_t size : {std::size_t{1}, kRemoteTargetSize, std::size_t{4000}}) {
    RemotePeer peer(path_);
    ASSERT_TRUE(peer.connected());
    cycles(1);
    const std::vector<std::uint8_t> bytes(size, 0xFF);
    peer.sendRaw(bytes);
    EXPECT_EQ(cycles(1).buttons, 0U);
    EXPECT_FALSE(device_->connected()) << size;
  }
}

TEST_F(RemoteDeviceTest, AFloodOrAPeerThatNeverReadsCostsBoundedWorkAndNoMemory) {
  RemotePeer peer(path_);
  cycles(1);
  for (int i = 0; i < 40; ++i) peer.send(Vector3(0.001 * i, 0.0, 0.0));
  EXPECT_TRUE(device_->connected());
  DeviceState state;
  device_->read(state);  // warm-up
  const test::RealtimeGuard guard;
  for (int i = 0; i < 200; ++i) {
    device_->read(state);
    device_->write({});
  }
  EXPECT_EQ(guard.allocations(), 0);
  EXPECT_EQ(guard.locks(), 0);
  EXPECT_TRUE(device_->connected());
  EXPECT_LT(peer.takeViews().value_or(0), 100) << "old views are lost, they do not pile up";
}

TEST_F(RemoteDeviceTest, APathThatIsInUseIsRefusedAndAnOldSocketReplaced) {
  EXPECT_THAT(RemoteDevice::open(path_).error().what, HasSubstr("another station listens there"));
  const std::string file = freshPath();
  std::ofstream(file) << "mine";
  EXPECT_THAT(RemoteDevice::open(file).error().what, HasSubstr("is no socket"));
  EXPECT_TRUE(std::filesystem::exists(file));
  std::filesystem::remove(file);
  EXPECT_THAT(RemoteDevice::open(std::string(200, 'x')).error().what, HasSubstr("too long"));
  EXPECT_THAT(RemoteDevice::open("/nosuchfolder/socket").error().what, HasSubstr("cannot be listened to"));

  const std::string old = freshPath();  // of a station that was killed
  const int socket_of_it = socket(AF_UNIX, SOCK_SEQPACKET, 0);
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  std::memcpy(name.sun_path, old.data(), old.size());
  ASSERT_EQ(bind(socket_of_it, reinterpret_cast<const sockaddr*>(&name), sizeof name), 0);
  close(socket_of_it);
  EXPECT_TRUE(RemoteDevice::open(old));
}

}  // namespace
}  // namespace tenon::devices
