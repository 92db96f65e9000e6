#pragma once

#include <memory>
#include <string>

#include "devices/device.h"
#include "devices/drivers/remote_messages.h"

namespace tenon::devices {

/// `remote`: a device that another program of the same user moves over a local socket, as the hand of a
/// browser. It displays no force: the program is shown proxy, force and contact in each cycle, and keeps its
/// target near the proxy, since nothing pushes back.
///
/// The hand goes to the newest target at up to 0.8 m/s and 6 rad/s. A peer that is silent for 100 cycles has
/// released its buttons, so its dead man's switch; after 2,000 it is disconnected. One peer at a time: a
/// second one is disconnected at once, and so is one whose message cannot be understood. Sockets are read and
/// written without waiting, a bounded number of messages in a cycle; views that a slow peer does not take are
/// lost.
///
/// Threads, Real-time: as HapticDevice; a cycle has system calls, none of which waits.
class RemoteDevice final : public HapticDevice {
 public:
  static constexpr unsigned kSilent = 100;  ///< [cycles] until the buttons of a silent peer count as released
  static constexpr unsigned kGone = 2000;   ///< [cycles] until it is disconnected
  static constexpr unsigned kWatchdog = 32;  ///< [cycles] without a write until its forces are off

  /// Listens at the path `address`, a socket of mode 0600; without an address nobody can connect. Fails when
  /// the path is in use, too long, or something else than a socket that nobody listens to.
  [[nodiscard]] static Result<std::unique_ptr<RemoteDevice>> open(const std::string& address);
  ~RemoteDevice() override;
  RemoteDevice(const RemoteDevice&) = delete;
  RemoteDevice& operator=(const RemoteDevice&) = delete;

  [[nodiscard]] const DeviceCaps& caps() const override { return caps_; }
  [[nodiscard]] Result<void> arm() override;
  void disarm() noexcept override;
  [[nodiscard]] Result<void> resetFault() override;
  void read(DeviceState& state) noexcept override;
  void write(const DeviceCommand& command) noexcept override;
  void show(const HandView& view) noexcept override { view_.shown = view; }

  [[nodiscard]] bool connected() const noexcept { return peer_ >= 0; }

 private:
  RemoteDevice();
  [[nodiscard]] Result<void> listenAt(const std::string& address);
  void acceptPeers() noexcept;
  void receiveTargets() noexcept;
  void dropPeer() noexcept;
  void follow() noexcept;

  DeviceCaps caps_;
  std::string path_;
  int listener_ = -1;
  int peer_ = -1;
  unsigned silence_ = 0;  ///< [cycles] since the last target
  unsigned cycles_since_write_ = 0;
  RemoteTarget target_;
  DeviceState state_;
  RemoteView view_;
};

}  // namespace tenon::devices
