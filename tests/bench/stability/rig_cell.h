#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "clients/rehearse/simulated_link.h"
#include "tests/bench/stability/rig_station.h"
#include "tests/bench/stability/situation.h"

namespace tenon::bench {

/// Losses of a link, with their name in tables.
struct RigLoss {
  std::string name;
  double share = 0.0;  ///< [-] of all messages
  Tick burst = 0;      ///< [ticks] LinkConditions::burst
};

/// What is measured in one cell of the table.
struct RigCell {
  std::string situation;
  RigModel model = RigModel::kManifold;
  Tick delay = 0;  ///< [ticks] one way
  std::string loss;

  // ---- a held contact, over its last two seconds, at the device's full stiffness
  double tip = 0.0;                 ///< [m] peak to peak of the hand's true position
  double ripple = 0.0;              ///< [N] RMS of the motors' force above 5 Hz
  double energy = 0.0;              ///< [J] that the motors gave the hand
  double mean_force = 0.0;          ///< [N]
  double coupling = 0.0;            ///< [N/m] stiffness in force, which links may limit
  double other_share = 0.0;         ///< [-] of two people: force at the first hand beside that at the other
  std::optional<double> stiffness;  ///< [N/m] largest that is stable; none of those that were tried
  bool judged = false;              ///< the situation has a held contact

  // ---- the device moves on a given path: force beside that of the manifold model without delay, at the
  // worst of the situation's phases
  double mean_error = 0.0;  ///< [-] RMS of the difference while all moves steadily, per RMS of the force
  double peak_error = 0.0;  ///< [N] largest difference
};

/// [N/m] what the rig's device renders passively, min(K_max, 2 b / T).
[[nodiscard]] double fullStiffness();

/// Measures cells. Deterministic: equal seeds give equal numbers.
///
/// Threads: one. Real-time: no.
class StabilityRig {
 public:
  explicit StabilityRig(std::uint64_t seed) : seed_(seed) {}

  [[nodiscard]] Result<RigCell> measure(const RigSituation& situation, RigModel model, Tick delay,
                                        const RigLoss& loss);

 private:
  [[nodiscard]] Result<void> compare(const RigSituation& situation, int phase,
                                     const rehearse::LinkConditions& link, RigCell& cell);

  std::uint64_t seed_;
  std::map<std::pair<std::string, int>, std::vector<Vector3>>
      references_;  ///< [N] forces without delay, by situation and phase
};

}  // namespace tenon::bench
