#pragma once

#include <array>
#include <cstdint>

#include "clients/haptic/world_view.h"
#include "idl/types/spatial.h"

namespace tenon::haptic {

/// How a free body in the copy of a scene is kept where the server has it. The copy simulates the body with
/// the hand's present pose; what the server had for the same input arrives a round trip later. The difference
/// to what the copy had for that input, less what was corrected since, is worked off within kSettle, by
/// kLargestStep a cycle at most. So a push is felt at once, and nothing that the server knows better stays.
///
/// Threads: one. Real-time: everything.
class PredictedBody {
 public:
  static constexpr double kSettle = 0.1;        ///< [s] time constant
  static constexpr double kLargestStep = 1e-3;  ///< [m] of any point, in a cycle
  static constexpr double kLost = 0.05;         ///< [m] of any point: the body is placed anew

  /// The body is where the server has it: nothing is to be corrected.
  void restart() noexcept;
  /// The server had `seen` for input `seq`.
  void compare(const ObservedObject& seen, std::uint32_t seq) noexcept;
  /// The body, of `radius` [m] about its centre, is too far from where the server has it.
  [[nodiscard]] bool isLost(double radius) const noexcept { return maxPointMotion(to_move_, radius) > kLost; }
  /// One cycle: changes pose and velocity by the next step of the correction. False: there is nothing to do.
  bool correct(const ObservedObject& seen, Pose& X_WO, Twist& V_WO) noexcept;
  /// What the copy has after a cycle with input `seq`.
  void record(std::uint32_t seq, const Pose& X_WO, const Twist& V_WO) noexcept {
    past_[seq % past_.size()] = {seq, X_WO, V_WO, moved_, changed_};
  }

 private:
  struct Past {
    std::uint32_t seq = 0;
    Pose X_WO;
    Twist V_WO;
    Displacement moved;  ///< by corrections so far
    Twist changed;       ///< likewise
  };
  std::array<Past, 512> past_{};  ///< by seq modulo its size
  Displacement moved_, to_move_;
  Twist changed_, to_change_;
};

}  // namespace tenon::haptic
