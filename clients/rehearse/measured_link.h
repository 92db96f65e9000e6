#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>

#include "clients/haptic/answer_loss.h"
#include "clients/haptic/force_age_statistics.h"
#include "clients/haptic/input_pacer.h"
#include "clients/haptic/limit_chooser.h"
#include "clients/haptic/link_clock.h"
#include "clients/haptic/rate_chooser.h"
#include "clients/rehearse/simulated_link.h"
#include "server/session/gap_meter.h"
#include "server/session/input_buffer.h"
#include "server/session/publisher.h"
#include "server/session/session_registry.h"

namespace tenon::rehearse {

/// A simulated link whose station measures it and chooses limits and rates, and whose server repeats lost
/// samples from later inputs and fills what is between sparse ones, as both do in real time. Clocks are that
/// of the ticks.
///
/// Threads: one. Real-time: no.
class MeasuredLink {
 public:
  /// `hands`: number of hands of the scenario.
  MeasuredLink(const LinkConditions& options, std::size_t hands) : link_(options), buffer_(hands) {}

  // ---- the station's side
  /// Gives the station what has arrived by tick `now`, and once a second what it has chosen.
  void deliver(Tick now, haptic::Station& station);
  /// The inputs of the station's step `now`.
  void send(std::span<const DeviceInput> inputs, Tick now);

  // ---- the server's side
  /// Adds to `readings` what tick `now` takes, and tells `registry` what `client` asks for.
  /// `refused` gets inputs that the registry refuses, with its reason; may be empty.
  void receive(Tick now, ClientId client, session::SessionRegistry& registry,
               FixedVector<session::HandReading, session::kMaxHands>& readings,
               const std::function<void(const DeviceInput&, const std::string&)>& refused);
  /// What a tick publishes, of the tier that the station has chosen.
  void send(const session::OutgoingMessages& outgoing, Tick now);

 private:
  static constexpr Tick kPeriod = 1000;  ///< [ticks] between two choices

  static std::int64_t nanoseconds(Tick tick) { return static_cast<std::int64_t>(tick) * 1'000'000; }
  void measure(Tick now);

  SimulatedLink link_;
  haptic::LinkClock clock_;
  haptic::ForceAgeStatistics ages_;
  haptic::AnswerLoss loss_;
  haptic::LimitChooser chooser_;
  haptic::LinkChoice choice_;
  haptic::RateChooser rates_;
  haptic::InputPacer pacer_;
  std::optional<double> round_trip_;  ///< [s] none: not known
  session::InputBuffer buffer_;
  session::GapMeter gaps_;
  std::uint32_t received_ = 0, newest_seq_ = 0;  ///< as ClockSync says them
  std::map<HandId, std::uint32_t> sent_;         ///< HandManifold::sent
  session::TickInput taken_;
};

}  // namespace tenon::rehearse
