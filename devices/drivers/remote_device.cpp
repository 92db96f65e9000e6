#include "devices/drivers/remote_device.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <numbers>

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "idl/types/messages/hands.h"

namespace tenon::devices {
namespace {

constexpr double kCycle = 1e-3;        // [s]
constexpr double kFollowTime = 0.010;  // [s] time constant in which the hand goes to the target
constexpr double kFollowSpeed = 0.8;   // [m/s] at most, below the speed at which the safety layer brakes
constexpr double kFollowTurn = 6.0;    // [rad/s] likewise
constexpr int kMessagesPerCycle = 16;
constexpr int kPeersPerCycle = 4;
constexpr int kViewBuffer = 8192;  // [bytes] what waits for a slow peer is old

DeviceCaps remoteCaps() {
  DeviceCaps caps;
  caps.model = "remote hand";
  caps.dof_mask = kAllDofs;
  // a person reaches the scene by a pointer, so the workspace is as large as a scene [assumed]
  caps.workspace_radius = 5.0;
  caps.indexing_radius = 4.0;
  caps.indexing_gain = 1.0;
  caps.rotation_range = std::numbers::pi;
  // what is shown is bounded as on a desk [assumed]; nothing is pushed, so no number is a limit of motors
  caps.continuous_force = 20.0;
  caps.peak_force = 20.0;
  caps.command_limit = 20.0;
  caps.torque = 2.0;
  caps.max_stiffness = 2000.0;
  caps.max_rotational_stiffness = 20.0;
  caps.physical_damping = 1.0;
  caps.physical_rotational_damping = 0.01;
  caps.max_speed = 1.0;
  caps.rate = 1.0 / kCycle;
  caps.dead_man = kRemoteHeld;
  caps.arming = kRemoteArm;
  caps.grip_range = 1.0;
  return caps;
}

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

RemoteDevice::RemoteDevice() : caps_(remoteCaps()) {}

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

Result<void> RemoteDevice::arm() {
  if (state_.fault != DeviceFault::kNone)
    return fail(caps_.model + ": cannot be armed after a fault (" + toString(state_.fault) +
                "), an operator resets it first");
  if (!state_.forces_on) cycles_since_write_ = 0;
  state_.forces_on = true;
  return {};
}

void RemoteDevice::disarm() noexcept {
  state_.forces_on = false;
  view_.F_Ho_D = {};
}

Result<void> RemoteDevice::resetFault() {
  state_.fault = DeviceFault::kNone;
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
    silence_ = 0;
    target_ = {};
    target_.X_DT = state_.X_DH;
  }
}

void RemoteDevice::dropPeer() noexcept {
  if (connected()) close(peer_);
  peer_ = -1;
  target_.buttons = 0;
}

void RemoteDevice::receiveTargets() noexcept {
  std::array<std::uint8_t, kRemoteTargetSize + 1> bytes;  // one more than a message: longer ones are seen
  for (int i = 0; i < kMessagesPerCycle && connected(); ++i) {
    const ssize_t size = recv(peer_, bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (size < 0 && (errno == EAGAIN || errno == EINTR)) return;
    const auto target =
        size > 0 ? decodeTarget({bytes.data(), static_cast<std::size_t>(size)}) : std::nullopt;
    if (!target) return dropPeer();
    target_ = *target;
    silence_ = 0;
    state_.stamp = std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
  }
}

void RemoteDevice::follow() noexcept {
  const Displacement off = displacement(state_.X_DH, target_.X_DT);
  const double share = kCycle / (kCycle + kFollowTime);
  const bool led = connected() && silence_ < kSilent;
  const Displacement step = led ? Displacement{clampNorm(share * off.translation, kFollowSpeed * kCycle),
                                               clampNorm(share * off.rotation, kFollowTurn * kCycle)}
                                : Displacement{};
  state_.X_DH = displaced(state_.X_DH, step);
  state_.V_DH = {step.translation / kCycle, step.rotation / kCycle};
}

void RemoteDevice::read(DeviceState& state) noexcept {
  ++state_.seq;
  if (state_.forces_on && ++cycles_since_write_ > kWatchdog) {
    disarm();
    state_.fault = DeviceFault::kStale;
  }
  if (listener_ >= 0) acceptPeers();
  if (connected()) receiveTargets();
  if (connected() && ++silence_ > kGone) dropPeer();
  if (silence_ >= kSilent) target_.buttons = 0;
  follow();
  state_.buttons = target_.buttons;
  state_.grip = target_.grip;
  state = state_;
}

void RemoteDevice::write(const DeviceCommand& command) noexcept {
  const bool finite = command.F_Ho_D.force.allFinite() && command.F_Ho_D.torque.allFinite();
  if (state_.forces_on) {
    cycles_since_write_ = 0;
    view_.F_Ho_D = finite ? command.F_Ho_D : Wrench{};
    if (!finite) {
      disarm();
      state_.fault = DeviceFault::kNonFinite;
    }
  }
  if (!connected()) return;
  view_.seq = target_.seq;
  view_.forces_on = state_.forces_on;
  view_.faulty = state_.fault != DeviceFault::kNone;
  view_.cycle = state_.seq;
  view_.X_DH = state_.X_DH;
  const auto bytes = encodeView(view_);
  const ssize_t sent = send(peer_, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent < 0 && errno != EAGAIN && errno != EINTR && errno != ENOBUFS) dropPeer();
}

}  // namespace tenon::devices
