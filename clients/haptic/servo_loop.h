#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <utility>

#include "clients/haptic/force_age_statistics.h"
#include "clients/haptic/station.h"
#include "idl/threads/clock.h"
#include "idl/threads/latest.h"
#include "idl/threads/spsc_queue.h"
#include "idl/types/messages/timing.h"

namespace tenon::haptic {

/// Output of a station in one millisecond.
struct StationOutput {
  std::uint32_t seq = 0;
  FixedVector<DeviceInput, kMaxStationHands> inputs;
  FixedVector<HandState, kMaxStationHands> states;

  void fill(const Station& station, std::uint32_t now) noexcept;
};

/// The largest force that was displayed since it was taken last, by state: the wire thread does not see all
/// outputs.
///
/// Threads: one that adds, one that takes. Real-time: everything.
class PeakForces {
 public:
  void add(const StationOutput& output) noexcept;
  /// [N]
  float take(std::size_t state) noexcept { return forces_[state].exchange(0.0F, std::memory_order_relaxed); }

 private:
  std::array<std::atomic<float>, kMaxStationHands> forces_{};  ///< [N]
};

/// The 1 kHz loop of a station in real time: gives the station what the wire thread has received, steps it,
/// and hands over what it puts out.
///
/// Threads: one (servo) for cycle(), one (wire) for all else. Real-time: cycle().
class ServoLoop {
 public:
  /// `wake` is called at the end of each cycle, and must be real-time. `station` outlives this. `clock`
  /// measures the cycles.
  ServoLoop(Station& station, std::function<void()> wake,
            std::shared_ptr<const threads::Clock> clock = std::make_shared<threads::SteadyClock>())
      : station_(station), wake_(std::move(wake)), clock_(std::move(clock)) {}

  void cycle() noexcept;
  /// The next cycles take the forces away, and with `disarms` switch the devices off.
  void finish(bool disarms) noexcept { finish_ = disarms ? Finish::kDisarm : Finish::kRest; }
  /// They have.
  [[nodiscard]] bool finished() const noexcept { return finish_ == Finish::kDone; }
  /// After finish() and the end of the thread: another one may begin.
  void restart() noexcept { finish_ = Finish::kNot; }

  void receive(const WorldFrame& frame) { frames_.push(frame); }
  void receive(const HandManifold& manifold) { manifolds_.push(manifold); }
  void receive(const Guidance& guidance) { guidances_.push(guidance); }
  /// Without its texts, so that copying it does not allocate.
  void receive(const StepState& step) { steps_.push(step); }
  void receive(const CollisionMatrix& matrix) { matrices_.push(matrix); }
  void receive(const StopSignal& stop) { stop_.write(stop); }
  void press() { presses_.push(true); }
  void setForceModel(ForceModelKind kind) noexcept { force_model_ = kind; }
  /// Station::setLinkJitter, `jitter` [s], and setLinkRoundTrip, `round_trip` [s].
  void setLink(double jitter, double round_trip) noexcept {
    link_jitter_ = jitter;
    link_round_trip_ = round_trip;
  }

  /// The newest output, if it is new; null: it is not.
  [[nodiscard]] const StationOutput* takeOutput() { return output_.update() ? &output_.value() : nullptr; }
  [[nodiscard]] float takePeak(std::size_t state) noexcept { return peaks_.take(state); }
  [[nodiscard]] bool takeEvent(StationEvent& event) { return events_.pop(event); }
  /// The statistics of the loop, once a second.
  [[nodiscard]] const Telemetry* takeTelemetry() {
    return telemetry_.update() ? &telemetry_.value() : nullptr;
  }
  /// The same at the end, when cycle() is called no more.
  [[nodiscard]] Telemetry statistics();

 private:
  enum class Finish { kNot, kRest, kDisarm, kDone };

  void receiveAll(std::int64_t now) noexcept;

  Station& station_;
  std::function<void()> wake_;
  std::shared_ptr<const threads::Clock> clock_;
  std::atomic<Finish> finish_{Finish::kNot};  ///< kDone: by the loop; the others: by the wire thread
  std::atomic<ForceModelKind> force_model_{ForceModelKind::kManifold};
  std::atomic<double> link_jitter_{0.0};      ///< [s]
  std::atomic<double> link_round_trip_{0.0};  ///< [s]
  threads::SpscQueue<WorldFrame> frames_{128};
  threads::SpscQueue<HandManifold> manifolds_{128};
  threads::SpscQueue<Guidance> guidances_{64};
  threads::SpscQueue<StepState> steps_{16};
  threads::SpscQueue<CollisionMatrix> matrices_{16};
  threads::Latest<StopSignal> stop_;
  threads::SpscQueue<bool> presses_{16};
  threads::SpscQueue<StationEvent> events_{256};
  threads::Latest<StationOutput> output_;
  threads::Latest<Telemetry> telemetry_;
  PeakForces peaks_;
  // of the loop
  ForceAgeStatistics force_age_;
  std::uint32_t seq_ = 0;
  std::int64_t last_cycle_ = 0;  ///< [ns]
};

}  // namespace tenon::haptic
