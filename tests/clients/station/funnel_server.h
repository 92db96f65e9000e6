#pragma once

#include <vector>

#include "clients/haptic/local_model.h"
#include "clients/haptic/station.h"

namespace tenon::test {

/// Server of an analytic scene: a ball-shaped part at the right, to be inserted into a funnel.
///
///        \       /     rim 18 mm from the axis, 45 degrees down to
///         \     /      a guide of 1 mm play,
///          |   |       with a seat 55 mm below the rim
///          |___|
///
/// The part has contacts at its origin only, so no contact turns it. Steps: touch the part for 1 s; insert
/// it.
class FunnelServer {
 public:
  static constexpr HandId kRight{0};
  static constexpr ObjectId kBlock{0}, kPointer{1}, kPart{2};
  static constexpr double kPartRadius = 0.05;  ///< [m]
  /// [rad] accepted angle error: the aiming error, which no contact corrects here.
  static constexpr double kAngleTolerance = 0.06;

  FunnelServer() {
    const auto add = [this](const char* kind, const Vector3& at, const Vector3& size) {
      SceneObject object;
      object.object = ObjectId{static_cast<std::uint32_t>(objects_.size())};
      object.kind = kind;
      object.X_WO = Pose(at);
      object.size = size;
      objects_.push_back(object);
    };
    add("scene", {0.0, 0.5, 0.4}, {0.8, 0.8, 0.8});
    add("pointer", {0.3, -0.35, 1.0}, Vector3::Constant(0.024));
    add("part", {0.6, -0.4, 1.0}, Vector3::Constant(2.0 * kPartRadius));
    world_.begin(objects_, 1, 0);
    part_ = objects_[2].X_WO;
  }

  void welcome(haptic::Station& station) const {
    Welcome welcome;
    welcome.accepted = true;
    welcome.client = ClientId{1};
    welcome.server_epoch = 1;
    for (const std::string& name : station.handNames()) {
      welcome.hands.push_back(name == "right" ? kRight : HandId{});
      welcome.objects.push_back(name == "right" ? kPointer : ObjectId{});
    }
    station.welcome(welcome, objects_);
  }

  /// One millisecond of station and server.
  void step(haptic::Station& station) {
    ++tick_;
    static_cast<void>(station.armDevices());
    station.step(static_cast<std::uint32_t>(tick_));
    const DeviceInput& input = station.inputs()[0];
    const Pose& X_WH = input.sample.X_WH;
    const HandManifold manifold = contacts(X_WH);
    model_.receive(manifold);
    const Pose X_WO = model_.step(X_WH, world_).X_WO;
    (grabbed ? part_ : pointer_) = X_WO;
    in_contact = model_.proxy().touching;
    updateTask(X_WH);
    publish(station, X_WH);
  }
  /// At most `seconds` [s] of session time.
  void run(haptic::Station& station, double seconds) {
    for (int i = 0; i < static_cast<int>(seconds * 1000.0) && !over; ++i) step(station);
  }

  [[nodiscard]] Displacement error() const { return displacement(part_, target()); }
  [[nodiscard]] static Pose target() { return Pose(Vector3(0.0, 0.5, 0.745)); }

  bool collisions = true;
  bool grabbed = false;
  bool over = false;
  bool in_contact = false;
  double highest_force = 0.0;  ///< [N]
  double highest_speed = 0.0;  ///< [m/s]
  bool indexed_in_contact = false;

 private:
  [[nodiscard]] HandManifold contacts(const Pose& X_WH) const {
    HandManifold manifold;
    manifold.hand = kRight;
    manifold.server_epoch = 1;
    manifold.tick = tick_;
    manifold.answers_seq = static_cast<std::uint32_t>(tick_);
    manifold.object = grabbed ? kPart : kPointer;
    manifold.object_epoch = grabbed ? 2 : 1;
    manifold.X_HO = grabbed ? X_HPart_ : Pose();
    manifold.X_WO = grabbed ? part_ : (tick_ == 1 ? X_WH : pointer_);
    manifold.stiffness = 1000.0;
    manifold.rotational_stiffness = 20.0;
    manifold.validity_radius = 1.0;
    if (!collisions && grabbed) return manifold;
    const Vector3 p = manifold.X_WO.translation();
    const auto plane = [&](ObjectId other, const Vector3& n, const Vector3& through_W) {
      const Vector3 p_A = world_.object(other).X_WO.inverse() * through_W;
      ManifoldContact contact;
      contact.other = other;
      contact.normal_A = n.cast<float>();
      contact.offset = static_cast<float>(n.dot(p_A));
      contact.gap = static_cast<float>(n.dot(p - through_W));
      manifold.contacts.push_back(contact);
    };
    if (!grabbed) {
      const Vector3 from_part = p - part_.translation();
      const Vector3 n = from_part.norm() > 1e-6 ? Vector3(from_part.normalized()) : Vector3(Vector3::UnitZ());
      plane(kPart, n, part_.translation() + n * (kPartRadius + 0.012));
      return manifold;
    }
    const Vector3 seat = target().translation();
    Vector3 off = p - seat;
    const double height = off.z() - 0.055;  // above the rim
    off.z() = 0.0;
    const double radius = off.norm();
    const Vector3 out = radius > 1e-9 ? Vector3(off / radius) : Vector3(Vector3::UnitX());
    const Vector3 rim = seat + Vector3(0.0, 0.0, 0.055);
    plane(kBlock, Vector3::UnitZ(), seat);
    if (radius >= 0.018) plane(kBlock, Vector3::UnitZ(), rim);
    if (radius < 0.018 && height > -0.0171) {
      plane(kBlock, (Vector3::UnitZ() - out).normalized(), rim + 0.018 * out);
    } else if (height <= -0.017) {
      plane(kBlock, -out, seat + 0.001 * out);
    }
    return manifold;
  }

  void updateTask(const Pose& X_WH) {
    if (!grabbed) {
      touched_ = in_contact ? touched_ + 1 : 0;
      if (touched_ < 1000) return;
      grabbed = true;
      X_HPart_ = X_WH.inverse() * part_;
      ++revision_;
      return;
    }
    const Displacement off = error();
    if (off.translation.norm() < 0.002 && off.rotation.norm() < kAngleTolerance && ++in_place_ > 300)
      over = true;
  }

  void publish(haptic::Station& station, const Pose& X_WH) {
    WorldFrame frame;
    frame.server_epoch = 1;
    frame.tick = tick_;
    for (std::uint32_t i = 0; i < 3; ++i) {
      ObjectState state;
      state.object = ObjectId{i};
      state.X_WO = i == 0 ? objects_[0].X_WO : i == 1 ? pointer_ : part_;
      state.epoch = i == 2 && grabbed ? 2 : 1;
      state.status = static_cast<std::uint8_t>(ObjectStatus::kHeld);
      frame.states.push_back(state);
    }
    world_.receive(frame);
    station.receive(frame);
    station.receive(contacts(X_WH));
    if (revision_ != published_) {
      published_ = revision_;
      StepState step;
      step.revision = revision_;
      step.step = revision_ - 1;
      step.steps = 2;
      step.started = tick_;
      step.phase = StepPhase::kActive;
      step.hand = kRight;
      if (grabbed) {
        step.object = kPart;
        step.has_target = true;
        step.X_WG = target();
        step.approach_W = -Vector3::UnitZ();
        step.approach_distance = 0.2;
        step.tolerance = 0.002;
      } else {
        step.touch = kPart;
        step.object = kPart;
      }
      station.receive(step);
    }
    const HandState& state = station.states()[0];
    highest_force = std::max(highest_force, state.F_Ho_W.force.norm());
    // mean over 50 ms: a single reading is quantised by the encoder
    if (tick_ % 50 == 0) {
      highest_speed = std::max(highest_speed, (X_WH.translation() - last_.translation()).norm() * 20.0);
      last_ = X_WH;
    } else if (tick_ == 1) {
      last_ = X_WH;
    }
    if (in_contact && contact_ticks_ > 2 && (state.p_WC - centre_).norm() > 0.0) indexed_in_contact = true;
    contact_ticks_ = in_contact ? contact_ticks_ + 1 : 0;
    centre_ = state.p_WC;
  }

  std::vector<SceneObject> objects_;
  haptic::WorldView world_;
  haptic::LocalModel model_;
  Pose part_, pointer_, X_HPart_, last_;
  Vector3 centre_ = Vector3::Zero();
  Tick tick_ = 0;
  int touched_ = 0;
  int in_place_ = 0;
  int contact_ticks_ = 0;
  std::uint32_t revision_ = 1;
  std::uint32_t published_ = 0;
};

}  // namespace tenon::test
