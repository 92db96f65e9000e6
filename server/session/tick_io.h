#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/fixed_vector.h"
#include "idl/types/messages.h"
#include "idl/types/result.h"
#include "server/game_control/state_machine.h"

namespace tenon {

/// A fresh reading of one hand's device.
struct HandReading {
  HandId hand;
  std::uint32_t seq = 0;
  bool active = true;  ///< false: the station holds its device still
  Pose X_WH;
  Twist V_WH;
  std::uint32_t buttons = 0;
};

enum class ChangeKind : std::uint8_t {
  kAttach,   ///< a client begins to move `hand`
  kDetach,   ///< nobody moves `hand` any more: what it holds is parked
  kGame,     ///< a command for the state machine
  kRelease,  ///< let go of what `hand` holds
  kPair,     ///< switch pair number `index` on or off (value)
  kPause,
  kResume,
  kHalt,        ///< emergency stop: value 1 engages, 0 clears
  kContribute,  ///< a force from outside on `object`
  kPlace,       ///< an outside tracker says where `object` is
  kStop,
  kBudget,  ///< ticks may test `value` points from now on; 0: as many as there are
};

/// Something decided outside the tick that the tick takes over.
struct Change {
  ChangeKind kind = ChangeKind::kGame;
  HandId hand;
  ObjectId object;
  std::uint32_t index = 0;
  std::uint32_t lifetime_ticks = 0;
  double value = 0.0;
  GameCommand game;
  Wrench F_Oo_W;
  Pose X_WO;
};

/// [ticks] between the samples of the slow tier.
inline constexpr Tick kHundredHertz = 10;

inline constexpr std::size_t kMaxHands = 16;
inline constexpr std::size_t kMaxChanges = 16;

/// Exactly what one tick consumes: with the state before it, it decides the state after it, to the last bit.
struct TickInput {
  Tick tick = 0;
  FixedVector<HandReading, kMaxHands> readings;
  FixedVector<Change, kMaxChanges> changes;
};

/// How a pair stands, with its number in the scene.
struct PairState {
  std::uint32_t pair = 0;
  PairContact contact;
};

/// Of the collision and configuration matrices, so many cells are told in turn with each slow sample.
inline constexpr std::size_t kPairsInTurn = kPairsPerSample;

/// What one tick leaves for everybody outside it. Sized once by Exercise::makeOutput; filled without
/// allocating.
struct TickOutput {
  Tick tick = 0;
  std::uint64_t hash = 0;
  RunPhase phase = RunPhase::kWaitingForPeople;
  bool emergency_stop = false;
  StepStatus step;
  std::vector<ObjectState> objects;
  std::vector<HandManifold> manifolds;  ///< index = HandId
  std::vector<bool> present;            ///< index = HandId: a client moves this hand
  std::vector<std::uint32_t> ages;      ///< index = HandId: ticks since its last reading
  std::vector<PairState> pairs;         ///< those that list contacts; no others press
  /// Whatever they do, in turn: all of a scene within a second, or as many as fit.
  FixedVector<PairState, kPairsInTurn> pairs_in_turn;
  TickStats stats;
};

/// The bytes of a TickInput in a journal, and back. Reading refuses anything that is not exactly one.
void appendBytes(const TickInput& input, std::vector<std::uint8_t>& bytes);
[[nodiscard]] Result<TickInput> readTickInput(std::span<const std::uint8_t> bytes);

}  // namespace tenon
