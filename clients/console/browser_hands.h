#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "clients/console/channel.h"
#include "clients/console/seat_rights.h"
#include "clients/console/web_options.h"

namespace tenon::console {

/// The hands of people at browsers who take part. Each person has a station as any other: a client of the
/// session with a DDS participant and a 1 kHz loop, whose devices are BrowserDevices. It leaves when the
/// browser is gone or nothing is heard of it.
///
/// A hand that somebody else moves is asked for during some seconds, so that a simulated person can make
/// room.
///
/// Threads: any, move from one; no function waits but the destructor. `answer` and `show` are called by
/// threads of this. Real-time: no.
class BrowserHands {
 public:
  static constexpr std::size_t kMaxSeats = 4;

  using Answer = std::function<void(ViewerId, const DeskAnswer&)>;
  /// Views of all hands of a viewer, one after the other as devices::encodeView makes them.
  using Show = std::function<void(ViewerId, Payload)>;
  /// A line for the terminal.
  using Print = std::function<void(const std::string&)>;

  BrowserHands(SeatRights rights, Answer answer, Show show, Print print);
  ~BrowserHands();
  BrowserHands(const BrowserHands&) = delete;
  BrowserHands& operator=(const BrowserHands&) = delete;

  /// A request of DeskRequest::isOfHands(). It is answered once: a place that was given when its hands have
  /// shown their first view; when it is lost, once more with id 0.
  void handle(ViewerId viewer, const std::string& session, const DeskRequest& request);
  /// Targets for all hands of the viewer, one after the other as devices::decodeTarget reads them. False when
  /// they are none, or the viewer has no hands: then nothing moves.
  [[nodiscard]] bool move(ViewerId viewer, std::span<const std::uint8_t> targets);
  /// The viewer's hands are given up.
  void left(ViewerId viewer);

 private:
  class Seat;

  void take(ViewerId viewer, const std::string& session, const DeskRequest& request);
  void leave(ViewerId viewer);
  void showViews();

  SeatRights rights_;
  Answer answer_;
  Show show_;
  Print print_;
  std::mutex mutex_;
  std::map<ViewerId, std::unique_ptr<Seat>> seats_;
  std::vector<std::unique_ptr<Seat>> left_;  ///< their threads end
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace tenon::console
