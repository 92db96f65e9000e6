#pragma once

#include <cstdint>
#include <optional>

#include "clients/haptic/force_model_chooser.h"
#include "clients/haptic/input_pacer.h"
#include "clients/haptic/limit_chooser.h"
#include "clients/haptic/link_clock.h"
#include "clients/haptic/rate_chooser.h"
#include "clients/haptic/station_link.h"

namespace tenon::haptic {

/// What a station measures of its link, and what it chooses by it once a second: the limits of its hands, how
/// often it sends and hears, the force model.
///
/// Threads: one (wire). Real-time: no.
class LinkAdaptation {
 public:
  /// `link` must outlive this.
  LinkAdaptation(StationLink& link, ForceModelWish wish) : link_(link), models_(wish) {}

  /// To the server's clock. In real time alone: the time of a session in lockstep is that of its ticks.
  [[nodiscard]] Result<void> subscribe();
  /// Asks the server for its clock when that is due.
  void askClock();
  /// `inputs` samples of DeviceInput were sent in step `seq` of the station.
  void sent(std::uint32_t seq, std::uint32_t inputs) noexcept { clock_.sent(seq, inputs); }
  /// The server or the seat was gone for a while.
  void interrupted() noexcept {
    limits_.interrupted();
    clock_.interrupted();
  }
  /// The server is another process, maybe on another machine.
  void resetClock() { clock_ = {}; }

  /// Completes the statistics of the last second by what is measured here, and chooses the limits that they
  /// ask for. `slow_lost` [-] of the answers, where all of this second were slow ones; none: not known.
  void measure(Telemetry& telemetry, std::optional<double> slow_lost);
  /// After measure(), and in lockstep once: `has_scene`: the station has the compiled scene.
  ForceModelKind chooseModel(bool has_scene) {
    return model_ = models_.step(round_trip_, has_scene, late_cycles_);
  }
  /// For a station that has its copy of the scene before it has measured its link.
  ForceModelKind chooseFirstModel(bool has_scene) { return model_ = models_.step(0.0, has_scene, 0); }
  /// Whether slow answers suffice from now on. After chooseModel().
  [[nodiscard]] bool chooseRates();

  [[nodiscard]] ForceModelKind model() const noexcept { return model_; }
  /// [s] of the last second; none: not known.
  [[nodiscard]] std::optional<double> roundTrip() const noexcept { return round_trip_; }
  [[nodiscard]] bool isLong() const noexcept { return round_trip_ > ForceModelChooser::kLong; }
  /// [s] by which answers may be older than the link's delay, for Station::setLinkJitter.
  [[nodiscard]] double jitter() const noexcept { return choice_.jitter + rates_.allowance(); }
  /// [ticks] between two HandStates.
  [[nodiscard]] std::uint32_t statePeriod() const noexcept { return rates_.statePeriod(); }
  /// InputPacer::due; `keeps_back`: with as many earlier samples as the link may lose.
  [[nodiscard]] std::optional<DeviceInput> due(const DeviceInput& input, std::size_t index, std::uint32_t seq,
                                               bool keeps_back) noexcept {
    return pacer_.due(input, index, seq, rates_, keeps_back ? choice_.playout_ticks : 0);
  }

 private:
  [[nodiscard]] std::uint64_t lateCycles(const Telemetry& telemetry);

  StationLink& link_;
  LinkClock clock_;
  LimitChooser limits_;
  LinkChoice choice_;
  ForceModelChooser models_;
  ForceModelKind model_ = ForceModelKind::kManifold;
  RateChooser rates_;
  InputPacer pacer_;
  std::optional<double> round_trip_;       ///< [s]
  std::uint64_t late_cycles_ = 0;          ///< of the last second
  std::uint64_t late_cycles_counted_ = 0;  ///< as the last Telemetry has them
};

}  // namespace tenon::haptic
