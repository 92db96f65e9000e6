#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/messages/objects.h"

namespace tenon::haptic {

/// Last received state of an object, and the place and size of its surface in its frame.
struct ObservedObject {
  Pose X_WO;
  Twist V_WO;
  std::uint32_t epoch = 0;
  ObjectStatus status = ObjectStatus::kHidden;
  HandId holder;
  bool in_contact = false;
  Tick updated_at = 0;  ///< server tick of this state
  Tick jumped_at = 0;   ///< server tick of the first state with this epoch; 0: no other was heard
  Vector3 p_OQ_O = Vector3::Zero();  ///< [m] its centre, of its bounding box
  double radius = 0.0;               ///< [m] half the diagonal of that box; 0 when it is not known

  /// Visible and collidable.
  [[nodiscard]] bool present() const { return status != ObjectStatus::kHidden; }
};

/// Last received state of all objects of a session.
///
/// A frame may carry only some objects (changed ones first), so each object has its own age. A frame of an
/// older server epoch is ignored; one of a newer epoch resets the ages.
///
/// Threads: one. Real-time: everything but begin().
class WorldView {
 public:
  /// Allocates; the objects take their initial poses from the scene.
  void begin(std::span<const SceneObject> objects, std::uint32_t server_epoch, Tick tick);
  /// False when the frame was ignored because of an older server epoch.
  bool receive(const WorldFrame& frame) noexcept;

  /// What is known from elsewhere. Precondition: contains(object).
  void set(ObjectId object, const Pose& X_WO, std::uint32_t epoch) noexcept {
    objects_[object.value].X_WO = X_WO;
    objects_[object.value].epoch = epoch;
  }

  [[nodiscard]] bool contains(ObjectId object) const noexcept { return object.value < objects_.size(); }
  /// Precondition: contains(object).
  [[nodiscard]] const ObservedObject& object(ObjectId object) const noexcept {
    return objects_[object.value];
  }
  [[nodiscard]] std::size_t size() const noexcept { return objects_.size(); }
  /// Newest received tick.
  [[nodiscard]] Tick tick() const noexcept { return tick_; }
  [[nodiscard]] std::uint32_t serverEpoch() const noexcept { return server_epoch_; }

 private:
  std::vector<ObservedObject> objects_;
  Tick tick_ = 0;
  std::uint32_t server_epoch_ = 0;
};

}  // namespace tenon::haptic
