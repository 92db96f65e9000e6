#pragma once

#include <limits>

#include "devices/device.h"
#include "devices/drivers/remote_messages.h"

namespace tenon::devices {

struct RemoteLimits {
  unsigned silent = 100;  ///< [cycles] until the buttons of a silent peer count as released
  unsigned gone = 2000;   ///< [cycles] until it is given up
  /// How far the hand goes from its proxy: of a peer that does not keep its target near the proxy itself.
  double reach = std::numeric_limits<double>::infinity();  ///< [m]
  double turn = std::numeric_limits<double>::infinity();   ///< [rad]
  double stiffness = 2000.0;                               ///< [N/m] of the coupling, at most
};

/// What devices have in common that a program moves (the peer), whatever carries the messages.
///
/// No force is displayed: the peer is shown proxy, force and contact in each cycle. The hand goes to the
/// newest target at up to 0.8 m/s and 6 rad/s. A peer that is silent has released its buttons, so its dead
/// man's switch, and the hand stands still; after RemoteLimits::gone it is given up. An arming button that is
/// down in a peer's first message, or when the peer is heard again, is not pressed: it has to be seen up
/// first.
///
/// Threads, Real-time: as HapticDevice.
class RemoteModel : public HapticDevice {
 public:
  static constexpr unsigned kWatchdog = 32;  ///< [cycles] without a write until its forces are off

  [[nodiscard]] const DeviceCaps& caps() const final { return caps_; }
  [[nodiscard]] Result<void> arm() final;
  void disarm() noexcept final;
  [[nodiscard]] Result<void> resetFault() final;
  void read(DeviceState& state) noexcept final;
  void write(const DeviceCommand& command) noexcept final;
  void show(const HandView& view) noexcept final { view_.shown = view; }

 protected:
  explicit RemoteModel(const RemoteLimits& limits);

  /// Once a cycle: what has arrived is handed to lead().
  virtual void receive() noexcept = 0;
  /// Once a cycle, with a peer.
  virtual void send(const RemoteView& view) noexcept = 0;
  /// The peer was silent for too long.
  virtual void giveUp() noexcept = 0;

  /// A peer has come: the hand stays where it is until it says otherwise.
  void meetPeer() noexcept;
  void losePeer() noexcept;
  [[nodiscard]] bool hasPeer() const noexcept { return has_peer_; }
  void lead(const RemoteTarget& target) noexcept;

 private:
  void follow() noexcept;
  [[nodiscard]] Pose goal() const noexcept;

  DeviceCaps caps_;
  RemoteLimits limits_;
  bool has_peer_ = false;
  unsigned silence_ = 0;        ///< [cycles] since the last target
  bool awaits_release_ = true;  ///< of the arming button, which was not heard of yet, or for a while
  unsigned cycles_since_write_ = 0;
  RemoteTarget target_;
  DeviceState state_;
  RemoteView view_;
};

}  // namespace tenon::devices
