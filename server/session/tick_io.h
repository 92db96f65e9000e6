#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/fixed_vector.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/timing.h"
#include "idl/types/result.h"
#include "server/game_control/state_machine.h"

namespace tenon::session {

/// A new device sample of one hand, already validated by the SessionRegistry; with the steps of
/// idl/types/resolution.h. The simulation makes its quaternion a unit one.
struct HandReading {
  HandId hand;
  std::uint32_t seq = 0;
  bool active = true;  ///< false: the station's safety layer holds its device still
  Pose X_WH;
  Twist V_WH;
  std::uint32_t buttons = 0;  ///< as DeviceSample::buttons
};

/// Which members of a Change are used is said at each kind. The numbers are part of the journal.
enum class ChangeKind : std::uint8_t {
  kAttach,            ///< a client starts to control `hand`, whose coupling has `stiffness`
  kDetach,            ///< no client controls `hand` any more: the object it holds is parked
  kGameCommand,       ///< `game` for the state machine
  kRelease,           ///< `hand` releases the object it holds
  kEnablePair,        ///< collision pair `index` of the scene: `value` 0 disables, else enables
  kPause,             ///< of a running session
  kResume,            ///< of a paused session
  kSetEmergencyStop,  ///< `value` 0 clears, else engages
  kContributeForce,   ///< external wrench `F_Oo_W` on `object` from source `index` for `lifetime_ticks`
  kPlaceObject,  ///< `object` is set to the externally tracked pose `X_WO`; of an object with a tracker of
                 ///< its own, that counts again after `lifetime_ticks`
  kStop,         ///< the run ends
  kBudget,       ///< from now on a tick may test `value` [points]; 0 or NaN: no limit
  kTake,  ///< `hand` holds `object` with the hand's frame at the object's, which is moved to the hand's pose
  kContinue,      ///< the first of a new life of the server (readResumePoint): no client controls a hand
  kFreezeForces,  ///< `value` 0: hands move again, else they are held still
  kSetLimits,     ///< of `hand`, until it is detached: it freezes above `index` [ticks], and parks at
                  ///< `lifetime_ticks`; the session's own limits are the shortest. `value` [s]: round trip
                  ///< of its station's link, which limits the stiffness of two hands on one object
};

/// An input of a tick other than device samples: decided outside the tick, applied at its start.
struct Change {
  ChangeKind kind = ChangeKind::kGameCommand;
  HandId hand;
  ObjectId object;
  std::uint32_t index = 0;           ///< of a collision pair or force source, by kind
  std::uint32_t lifetime_ticks = 0;  ///< [ticks]
  double value = 0.0;                ///< [-], [points] or [s], by kind
  HandStiffness stiffness;
  game_control::GameCommand game;
  Wrench F_Oo_W;
  Pose X_WO;
};

/// [ticks] between samples of the 100 Hz topics.
inline constexpr Tick kPeriod100Hz = 10;

/// [ticks] for which an ExternalPose replaces an object's own tracker, at most.
inline constexpr Tick kMaxExternalPoseTicks = 1000;

inline constexpr std::size_t kMaxHands = 16;
inline constexpr std::size_t kMaxChanges = 16;

/// Commands to the state machine that wait, those on their way to the simulation included: of some it takes
/// one a tick.
inline constexpr std::size_t kMostWaitingCommands = 256;

/// All inputs of one tick. Together with the state before the tick it determines the state after it, bit for
/// bit.
///
/// Threads: a value. Real-time: filling it; appendBytes while the capacity suffices.
struct TickInput {
  Tick tick = 0;
  /// at most one per hand; none for a hand without a new sample
  FixedVector<HandReading, kMaxHands> readings;
  FixedVector<Change, kMaxChanges> changes;  ///< in the order of their application
};

/// Contact state of one collision pair.
struct PairState {
  std::uint32_t pair = 0;  ///< index into Scene::pairs
  PairContact contact;
};

/// Pairs refreshed round robin with each 100 Hz sample, at most.
inline constexpr std::size_t kRoundRobinPairs = kPairsPerSample;

/// Commands to the state machine, by all ticks of this server.
struct CommandCounts {
  std::uint64_t taken = 0;    ///< with the inputs of ticks
  std::uint64_t waiting = 0;  ///< of them and of those of a checkpoint: for a later tick
  std::uint64_t dropped = 0;  ///< likewise, and not carried out: by an emergency stop or the end of the run
};

/// All outputs of one tick. Sized once by SessionSimulation::makeOutput; filled without allocating.
struct TickOutput {
  Tick tick = 0;
  std::uint64_t hash = 0;  ///< SessionSimulation::hash after the tick
  RunPhase phase = RunPhase::kWaitingForPeople;
  bool emergency_stop = false;
  bool forces_frozen = false;  ///< by ChangeKind::kFreezeForces
  game_control::StepStatus step;
  CommandCounts commands;
  std::vector<ObjectState> objects;     ///< index = ObjectId
  std::vector<HandManifold> manifolds;  ///< index = HandId; valid where `present`
  std::vector<bool> present;            ///< index = HandId: a client controls this hand and sends input
  std::vector<std::uint32_t> ages;      ///< [ticks] index = HandId: since the last device sample
  std::vector<PairState> pairs;         ///< pairs with a contact list; all others exert no force
  /// Every tenth tick: the next pairs in order of their index, touching or not. All pairs of a scene of up to
  /// 100 * kRoundRobinPairs are refreshed within a second.
  FixedVector<PairState, kRoundRobinPairs> round_robin_pairs;
  std::vector<std::uint8_t> collides;  ///< CollisionMatrix::bits of all parts
  TickStats stats;
};

/// Appends the journal's binary form of `input` (ByteWriter, native byte order) to `bytes`.
void appendBytes(const TickInput& input, std::vector<std::uint8_t>& bytes);
/// Reads what appendBytes wrote. Fails when `bytes` are truncated, have a rest, or a list exceeds its
/// capacity.
[[nodiscard]] Result<TickInput> readTickInput(std::span<const std::uint8_t> bytes);

}  // namespace tenon::session
