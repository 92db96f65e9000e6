#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "idl/types/messages/contacts.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/steps.h"
#include "idl/types/messages/timing.h"
#include "server/session/event_generator.h"
#include "server/session/tick_io.h"

namespace tenon::session {

/// The messages of one tick, by rate tier. Valid until the next call of Publisher::prepare.
struct OutgoingMessages {
  std::vector<WorldFrame> frames;      ///< WorldFrame_1k; empty in ticks that a newer one replaces
  std::vector<WorldFrame> frames_100;  ///< WorldFrame_100; empty in ticks between its samples
  std::vector<WorldFrame> frames_30;   ///< WorldFrame_30; likewise
  /// HandManifold; empty in ticks that a newer one replaces; of tracked hands at 100 Hz
  std::vector<const HandManifold*> manifolds;
  /// HandManifold_50: each 20 ticks, and between them for up to 30 a second, 12 at once, where a neighbour's
  /// goal is not where the one before lets it be expected
  std::vector<const HandManifold*> manifolds_50;
  std::vector<ContactPairs> pairs;       ///< at 100 Hz
  std::optional<TickStats> stats;        ///< at 100 Hz
  std::optional<StepProgress> progress;  ///< at 30 Hz
  TickEvents events;
};

/// Turns the output of each tick into messages of the rate tiers 1 kHz, 100 Hz, 50 Hz and 30 Hz. Peaks and
/// maxima of a slower tier cover all ticks since its last sample.
///
/// Threads: one (wire).
class Publisher {
 public:
  /// `complete`: each tick carries all objects and all manifolds (lockstep, where clients wait for them).
  Publisher(std::shared_ptr<const game_control::ScenarioFile> scenario, std::uint32_t server_epoch,
            bool complete);

  /// Must be called for every tick, in order: the returned messages cover `output` and the ticks before it.
  /// `is_newest`: false for a tick that a newer one follows at once; it has no frames and manifolds of 1 kHz,
  /// and what changed in it goes into those of the next one that has.
  const OutgoingMessages& prepare(const TickOutput& output, bool is_newest = true);
  [[nodiscard]] EventGenerator& eventGenerator() { return event_generator_; }

 private:
  /// A collision pair since the last 100 Hz sample.
  struct PairRecord {
    PairContact contact;  ///< of the newest tick, with the peaks of all
    Tick tick = 0;        ///< the newest tick
    bool due = false;     ///< goes into the next sample: it touched, or is refreshed round robin
  };

  /// What HandManifold_50 said last to a hand.
  struct SlowSample {
    Tick tick = 0;
    decltype(HandManifold::others) others;
    Tick refilled = 0;    ///< `tokens`
    double tokens = 0.0;  ///< [-] event-triggered samples that may be sent now
  };

  void addManifolds(const TickOutput& output, bool is_newest);
  static bool isTriggered(const HandManifold& now, SlowSample& last);
  void addPairs(const TickOutput& output);
  void addStats(const TickOutput& output);

  std::shared_ptr<const game_control::ScenarioFile> scenario_;
  std::uint32_t server_epoch_;
  bool complete_;
  EventGenerator event_generator_;
  FramePacker packer_1k_, packer_100_, packer_30_;
  OutgoingMessages outgoing_;
  std::vector<HandManifold> manifolds_;
  std::vector<SlowSample> slow_samples_;              ///< by hand
  std::map<std::uint32_t, PairRecord> pair_records_;  ///< by index of the pair
  TickStats stats_peak_;                              ///< since the last sample
};

}  // namespace tenon::session
