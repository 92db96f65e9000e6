#include "devices/drivers/remote_device.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <optional>

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

namespace tenon::devices {
namespace {

constexpr int kMessagesPerCycle = 16;
constexpr int kPeersPerCycle = 4;
constexpr int kViewBuffer = 8192;  // [bytes] what waits for a slow peer is old

std::string reason(const std::string& address, const char* what) {
  return address + ": " + what + " (" + std::strerror(errno) + ")";
}

/// Whether somebody listens at the socket; also one whose queue is full, because it stands still.
bool isServed(const sockaddr_un& name) {
  const int probe = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (probe < 0) return true;
  const bool served = connect(probe, reinterpret_cast<const sockaddr*>(&name), sizeof name) == 0 ||
                      (errno != ECONNREFUSED && errno != ENOENT);
  close(probe);
  return served;
}

}  // namespace

RemoteDevice::~RemoteDevice() {
  dropPeer();
  if (listener_ < 0) return;
  close(listener_);
  unlink(path_.c_str());
}

Result<std::unique_ptr<RemoteDevice>> RemoteDevice::open(const std::string& address) {
  std::unique_ptr<RemoteDevice> device(new RemoteDevice);
  if (address.empty()) return device;
  if (auto listens = device->listenAt(address); !listens) return fail(listens.error().what);
  return device;
}

Result<void> RemoteDevice::listenAt(const std::string& address) {
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  if (address.size() >= sizeof name.sun_path)
    return fail(address + ": is too long for a socket, expected " + std::to_string(sizeof name.sun_path - 1) +
                " characters at most");
  std::memcpy(name.sun_path, address.data(), address.size());
  struct stat status {};
  if (lstat(address.c_str(), &status) == 0) {
    if (!S_ISSOCK(status.st_mode))
      return fail(address + ": is there and is no socket; name another --address");
    if (isServed(name)) return fail(address + ": another station listens there; name another --address");
    unlink(address.c_str());
  }
  const int listener = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (listener < 0) return fail(reason(address, "no socket could be made"));
  // the mode that the socket gets when it is bound, so that it is never another's
  const bool bound = fchmod(listener, 0600) == 0 &&
                     bind(listener, reinterpret_cast<const sockaddr*>(&name), sizeof name) == 0;
  if (!bound || chmod(address.c_str(), 0600) != 0 || ::listen(listener, kPeersPerCycle) != 0) {
    auto failed = fail(reason(address, "cannot be listened to"));
    close(listener);
    if (bound) unlink(address.c_str());
    return failed;
  }
  listener_ = listener;
  path_ = address;
  return {};
}

void RemoteDevice::acceptPeers() noexcept {
  for (int i = 0; i < kPeersPerCycle; ++i) {
    const int peer = accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (peer < 0) return;
    if (connected()) {
      close(peer);
      continue;
    }
    setsockopt(peer, SOL_SOCKET, SO_SNDBUF, &kViewBuffer, sizeof kViewBuffer);
    peer_ = peer;
    meetPeer();
  }
}

void RemoteDevice::dropPeer() noexcept {
  if (connected()) close(peer_);
  peer_ = -1;
  losePeer();
}

void RemoteDevice::receive() noexcept {
  if (listener_ >= 0) acceptPeers();
  std::array<std::uint8_t, kRemoteTargetSize + 1> bytes;  // one more than a message: longer ones are seen
  for (int i = 0; i < kMessagesPerCycle && connected(); ++i) {
    const ssize_t size = recv(peer_, bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (size < 0 && (errno == EAGAIN || errno == EINTR)) return;
    const auto target =
        size > 0 ? decodeTarget({bytes.data(), static_cast<std::size_t>(size)}) : std::nullopt;
    if (!target) return dropPeer();
    lead(*target);
  }
}

void RemoteDevice::send(const RemoteView& view) noexcept {
  const auto bytes = encodeView(view);
  const ssize_t sent = ::send(peer_, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent < 0 && errno != EAGAIN && errno != EINTR && errno != ENOBUFS) dropPeer();
}

}  // namespace tenon::devices
