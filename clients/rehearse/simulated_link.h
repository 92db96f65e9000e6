#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "clients/haptic/station.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/timing.h"
#include "idl/types/random.h"

namespace tenon::rehearse {

/// What a network does to streams, alike in both directions.
struct LinkConditions {
  Tick delay = 0;     ///< [ticks] one way
  Tick jitter = 0;    ///< [ticks] a message takes up to so much longer, and may overtake others
  double loss = 0.0;  ///< [-] share of the messages that are lost, below 1
  Tick burst = 0;     ///< [ticks] mean length of a gap in which all are lost; 0: each is lost by itself
  std::uint64_t seed = 1;
};

/// One direction of a link: which messages arrive, and when.
///
/// Threads: one. Real-time: no.
class LinkDirection {
 public:
  LinkDirection(const LinkConditions& options, std::uint64_t seed) : options_(options), random_(seed) {}

  /// When a message that is sent at `now` arrives; none: it is lost. `now` never falls.
  [[nodiscard]] std::optional<Tick> arrival(Tick now);

 private:
  [[nodiscard]] bool isLost(Tick now);

  LinkConditions options_;
  Random random_;
  Tick now_ = 0;
  bool in_burst_ = false;
};

/// Messages under way.
///
/// Threads: one. Real-time: no.
template <class Message>
class DelayLine {
 public:
  void put(const Message& message, Tick arrival) { waiting_.emplace_back(arrival, message); }
  /// Calls `take` with each message that has arrived by `now`: by arrival, then as they were sent.
  template <class Take>
  void deliver(Tick now, Take take) {
    for (;;) {
      auto due = waiting_.end();
      for (auto it = waiting_.begin(); it != waiting_.end(); ++it)
        if (it->first <= now && (due == waiting_.end() || it->first < due->first)) due = it;
      if (due == waiting_.end()) return;
      take(due->second);
      waiting_.erase(due);
    }
  }

 private:
  std::vector<std::pair<Tick, Message>> waiting_;
};

/// The streams between a station and the server of a rehearsal, through a link that delays and loses: inputs
/// and clock requests up, frames, manifolds and clock answers down. What is reliable on the bus does not pass
/// it.
///
/// Deterministic: equal seeds and messages give equal arrivals.
///
/// Threads: one. Real-time: no.
class SimulatedLink {
 public:
  explicit SimulatedLink(const LinkConditions& options)
      : up_(options, 2 * options.seed),
        down_(options, 2 * options.seed + 1),
        requests_up_(options, ~(2 * options.seed)),
        answers_down_(options, ~(2 * options.seed + 1)) {}

  /// From the station in tick `now`.
  void send(const DeviceInput& input, Tick now);
  /// From the server in tick `now`; without a delay the station has it in the next one.
  void send(const WorldFrame& frame, Tick now);
  void send(const HandManifold& manifold, Tick now);
  /// Calls `take` with each input that the server has got by tick `now`, and the newest DeviceSample::seq of
  /// its hand before it; not with one that is older than that. Returns the number of those that came, of
  /// both.
  std::uint32_t receive(Tick now, const std::function<void(const DeviceInput&, std::uint32_t)>& take);
  /// Gives the station what has arrived by tick `now`, and `heard` the manifolds among it.
  void deliver(Tick now, haptic::Station& station, const std::function<void(const HandManifold&)>& heard);

  /// A request of the station's clock.
  void sendRequest(const ClockSync& request, Tick now);
  /// Calls `answer` with each request that the server has got by tick `now`, and sends back what that makes
  /// of it.
  void answerRequests(Tick now, const std::function<void(ClockSync&)>& answer);
  /// Calls `take` with each answer that the station has got by tick `now`.
  void deliverAnswers(Tick now, const std::function<void(const ClockSync&)>& take);

 private:
  LinkDirection up_, down_;
  LinkDirection requests_up_, answers_down_;  ///< of their own: measuring loses no other message
  DelayLine<DeviceInput> inputs_;
  DelayLine<WorldFrame> frames_;
  DelayLine<HandManifold> manifolds_;
  DelayLine<ClockSync> requests_, answers_;
  std::vector<std::pair<HandId, std::uint32_t>> newest_;  ///< DeviceSample::seq of each hand
};

}  // namespace tenon::rehearse
