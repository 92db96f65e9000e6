#pragma once

#include <memory>
#include <string>

#include "devices/drivers/remote_model.h"

namespace tenon::devices {

/// `remote`: a RemoteModel whose peer is another program of the same user, over a local socket. It keeps its
/// target near the proxy itself.
///
/// One peer at a time: a second one is disconnected at once, and so is one whose message cannot be
/// understood, or that is given up. Sockets are read and written without waiting, a bounded number of
/// messages in a cycle; views that a slow peer does not take are lost.
///
/// Threads, Real-time: as HapticDevice; a cycle has system calls, none of which waits.
class RemoteDevice final : public RemoteModel {
 public:
  static constexpr unsigned kSilent = RemoteLimits{}.silent;  ///< [cycles]
  static constexpr unsigned kGone = RemoteLimits{}.gone;      ///< [cycles]

  /// Listens at the path `address`, a socket of mode 0600; without an address nobody can connect. Fails when
  /// the path is in use, too long, or something else than a socket that nobody listens to.
  [[nodiscard]] static Result<std::unique_ptr<RemoteDevice>> open(const std::string& address);
  ~RemoteDevice() override;
  RemoteDevice(const RemoteDevice&) = delete;
  RemoteDevice& operator=(const RemoteDevice&) = delete;

  [[nodiscard]] bool connected() const noexcept { return hasPeer(); }

 private:
  RemoteDevice() : RemoteModel({}) {}
  [[nodiscard]] Result<void> listenAt(const std::string& address);
  void receive() noexcept override;
  void send(const RemoteView& view) noexcept override;
  void giveUp() noexcept override { dropPeer(); }
  void acceptPeers() noexcept;
  void dropPeer() noexcept;

  std::string path_;
  int listener_ = -1;
  int peer_ = -1;
};

}  // namespace tenon::devices
