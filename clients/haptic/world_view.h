#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/messages.h"

namespace tenon {

/// An object as this client last heard of it.
struct SeenObject {
  Pose X_WO;
  Twist V_WO;
  std::uint32_t epoch = 0;
  ObjectStatus status = ObjectStatus::kHidden;
  HandId holder;
  bool in_contact = false;
  Tick heard = 0;  ///< the server's tick it is of

  /// Can be seen and touched.
  [[nodiscard]] bool present() const { return status != ObjectStatus::kHidden; }
};

/// The scene as one client last heard of it.
///
/// A frame is packed and changed objects come first, so each object has its own age; a frame of an older life
/// of the server is ignored, one of a newer life starts the picture anew.
///
/// Threads: one. Real-time: everything but begin().
class WorldView {
 public:
  /// Sizes the view; objects stand where the scene says until a frame says otherwise.
  void begin(std::span<const SceneObject> objects, std::uint32_t server_epoch, Tick tick);
  /// False when the frame was of an older life of the server.
  bool receive(const WorldFrame& frame) noexcept;

  [[nodiscard]] bool knows(ObjectId object) const noexcept { return object.value < objects_.size(); }
  /// `knows(object)` must hold.
  [[nodiscard]] const SeenObject& object(ObjectId object) const noexcept { return objects_[object.value]; }
  [[nodiscard]] std::size_t size() const noexcept { return objects_.size(); }
  [[nodiscard]] Tick tick() const noexcept { return tick_; }
  [[nodiscard]] std::uint32_t serverEpoch() const noexcept { return server_epoch_; }

 private:
  std::vector<SeenObject> objects_;
  Tick tick_ = 0;
  std::uint32_t server_epoch_ = 0;
};

}  // namespace tenon
