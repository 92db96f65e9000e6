#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "clients/haptic/haptic_hand.h"
#include "clients/haptic/world_view.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/steps.h"

namespace tenon::haptic {

/// What the arm that holds a device intends, in the device's frame D.
struct ArmIntent {
  Pose X_DI;
  Twist V_DI;
  double contraction = 0.0;   ///< [-] co-contraction of its muscles, 0 relaxed to 1 braced
  std::uint32_t buttons = 0;  ///< that it presses, beside a dead man's switch
};

/// A hand of a station, as its mover finds it.
struct MovedHand {
  std::string name;            ///< in the scenario
  HapticHand* hand = nullptr;  ///< null: the session does not have it
  Pose X_WStart;               ///< at begin()
  ArmIntent intent;            ///< set by the mover
};

/// What moves the devices of a station that simulates its person: it reads what a person perceives and says
/// what the arms intend. A station without one is moved by who holds its devices.
///
/// Threads: one. Real-time: step.
class Mover {
 public:
  virtual ~Mover() = default;
  /// Called before the first step and after each return to the session; what it is given outlives it.
  virtual void begin(std::span<const SceneObject> objects, std::span<const MovedHand> hands) = 0;
  /// The step of the task is new.
  virtual void read(const StepState& /*step*/) {}
  /// One millisecond, after that of the hands: sets their intents.
  virtual void step(std::span<MovedHand> hands, const WorldView& world) noexcept = 0;
  /// What it does, in a word or two: for progress output and tests.
  [[nodiscard]] virtual const char* activity() const noexcept = 0;
};

}  // namespace tenon::haptic
