#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "idl/types/messages.h"
#include "server/session/chronicle.h"
#include "server/session/tick_io.h"

namespace tenon {

/// The messages of one tick, by rate tier. Valid until the next one is made.
struct Outgoing {
  std::vector<WorldFrame> frames;      ///< for WorldFrame_1k
  std::vector<WorldFrame> frames_100;  ///< empty when it is not their turn, as are the following
  std::vector<WorldFrame> frames_30;
  std::vector<const HandManifold*> manifolds;
  std::vector<ContactPairs> pairs;
  std::optional<TickStats> stats;
  std::optional<StepProgress> progress;
  News news;
};

/// Turns the outputs of ticks into what is sent, tier by tier. A slower tier carries the maxima since its
/// last sample.
///
/// Threads: one (wire).
class Broadcast {
 public:
  /// `everything`: each tick sends all objects and all manifolds (lockstep, where receivers count on them).
  Broadcast(std::shared_ptr<const ScenarioFile> scenario, std::uint32_t server_epoch, bool everything);

  const Outgoing& read(const TickOutput& output);
  [[nodiscard]] Chronicle& chronicle() { return chronicle_; }

 private:
  /// What a pair did since the last sample of the slow tier.
  struct Touch {
    PairContact contact;  ///< the newest, with the peaks
    Tick tick = 0;        ///< of the newest
    bool lately = false;  ///< to be told: it touched, or its turn has come
  };

  void addManifolds(const TickOutput& output);
  void addPairs(const TickOutput& output);
  void addStats(const TickOutput& output);

  std::shared_ptr<const ScenarioFile> scenario_;
  std::uint32_t server_epoch_;
  bool everything_;
  Chronicle chronicle_;
  FramePacker packer_1k_, packer_100_, packer_30_;
  Outgoing outgoing_;
  std::vector<HandManifold> manifolds_;
  std::map<std::uint32_t, Touch> touches_;  ///< by pair
  TickStats stats_peak_;
};

}  // namespace tenon
