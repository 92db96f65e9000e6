#pragma once

#include <deque>
#include <memory>
#include <vector>

#include "clients/haptic/scene_copy.h"
#include "tests/server/simulation/small_scene.h"

namespace tenon::test {

inline constexpr double kEdge = 0.04;         // [m] of block and part
inline constexpr double kStiffness = 2000.0;  // [N/m]
inline constexpr HandId kRight{0}, kLeft{1};
inline constexpr ObjectId kBlock{0}, kPart{1}, kGround{2};

//   block (right)   part (left)
//      [  ]  <->    [  ]          the hands' origins are at the centres
//   ============== floor, top at z = 0
inline std::shared_ptr<const simulation::Scene> blocks(double left_stiffness = kStiffness) {
  SmallScene small;
  const auto cube = boxShape(Vector3::Constant(kEdge));
  small.object("block", cube, {0.0, 0.0, 0.2});
  small.object("part", cube, {0.1, 0.0, 0.2});
  small.object("floor", boxShape({0.5, 0.3, 0.04}), {0.0, 0.0, -0.02}, ObjectStatus::kFixed);
  small.hand("right", kBlock);
  small.hand("left", kPart);
  small.pair(kBlock, kGround);
  small.pair(kBlock, kPart);
  small.pair(kPart, kGround);
  auto scene = std::make_shared<simulation::Scene>(*small.build());
  for (simulation::HandSpec& hand : scene->hands) hand.stiffness = kStiffness;
  scene->hands[kLeft.value].stiffness = left_stiffness;
  return scene;
}

/// How a server answers.
struct StationAnswers {
  Tick frame_period = 1, manifold_period = 1;  ///< [ticks]
  Tick manifolds_later = 0;                    ///< [ticks] than frames
};
inline constexpr StationAnswers kSlowAnswers{.frame_period = 10, .manifold_period = 20};

/// A server, and the station of the right hand `delay` ticks away. The left hand is at the server.
class DelayedStation {
 public:
  explicit DelayedStation(Tick delay, std::shared_ptr<const simulation::Scene> scene = blocks(),
                          const StationAnswers& answers = {})
      : server_(scene, {}), copy(scene), delay_(delay), answers_(answers) {
    time_.setRoundTrip(2.0 * kTickSeconds * static_cast<double>(delay));
    std::vector<SceneObject> objects(scene->objects.size());
    for (std::uint32_t i = 0; i < objects.size(); ++i) {
      objects[i].object = ObjectId{i};
      if (scene->objects[i].structures) objects[i].size = scene->objects[i].structures->info.box_M.sizes();
    }
    world_.begin(objects, 0, 0);
    for (std::uint32_t i = 0; i < scene->hands.size(); ++i) server_.setHandPresent(HandId{i}, true);
  }

  /// One millisecond with the device of the right hand at p_WH, and the left one at p_WLeft.
  void tick(const Vector3& p_WH, const Vector3& p_WLeft) {
    if (now_++ == 0) p_WLeft_ = p_WLeft;
    for (; !frames_.empty() && frames_.front().tick + delay_ < now_; frames_.pop_front())
      world_.receive(frames_.front());
    const Tick late = delay_ + answers_.manifolds_later;
    for (; !manifolds_.empty() && manifolds_.front().tick + late < now_; manifolds_.pop_front())
      local.receive(manifolds_.front());
    const auto seq = static_cast<std::uint32_t>(now_);
    if (local.hasManifold()) time_.receive(local.manifold(), seq);
    local.expectAt(time_.known() ? time_.tickOf(seq) : 0.0);
    copy.step(Pose(p_WH), world_);
    local.step(Pose(p_WH), world_);
    if (local.hasManifold()) {
      copy.compute(local.manifold(), seq, time_, Pose(p_WH), {}, world_, local.usable(world_));
    }

    inputs_.push_back({seq, p_WH});
    for (; !inputs_.empty() && inputs_.front().seq + delay_ <= now_; inputs_.pop_front()) {
      server_.setHandPose(kRight, Pose(inputs_.front().p_WH), {});
      answered_ = inputs_.front().seq;
    }
    server_.setHandPose(kLeft, Pose(p_WLeft), {(p_WLeft - p_WLeft_) / kTickSeconds, Vector3::Zero()});
    p_WLeft_ = p_WLeft;
    server_.step();
    send();
  }

  [[nodiscard]] simulation::Environment& server() { return server_; }
  [[nodiscard]] const haptic::WorldView& world() const { return world_; }
  /// [N] of the coupling without its damping.
  [[nodiscard]] static Vector3 force(const haptic::LocalProxy& proxy, const Vector3& p_WH) {
    return kStiffness * (proxy.X_WS.translation() - p_WH);
  }

  bool is_silent = false;  ///< the server's answers are lost

 private:
  struct Input {
    std::uint32_t seq = 0;
    Vector3 p_WH;
  };
  void send() {
    if (is_silent) return;
    WorldFrame frame;
    frame.tick = now_;
    for (std::uint32_t i = 0; i < server_.objects().size(); ++i) {
      const simulation::ObjectMotion& motion = server_.objects()[i];
      ObjectState state{ObjectId{i}, motion.epoch, motion.X_WO};
      state.V_WO << motion.V_WO.linear.cast<float>(), motion.V_WO.angular.cast<float>();
      state.status = static_cast<std::uint8_t>(motion.status);
      state.holder = motion.holder;
      frame.states.push_back(state);
    }
    if (now_ % answers_.frame_period == 0) frames_.push_back(frame);
    HandManifold manifold;
    server_.manifold(kRight, manifold);
    manifold.tick = now_;
    manifold.answers_seq = answered_;
    if (now_ % answers_.manifold_period == 0) manifolds_.push_back(manifold);
  }

  simulation::Environment server_;
  haptic::WorldView world_;
  haptic::ServerTime time_;
  std::deque<Input> inputs_;
  std::deque<WorldFrame> frames_;
  std::deque<HandManifold> manifolds_;
  std::uint32_t answered_ = 0;
  Tick now_ = 0;
  Vector3 p_WLeft_ = Vector3::Zero();

 public:
  haptic::SceneCopy copy;
  haptic::LocalModel local;

 private:
  Tick delay_;
  StationAnswers answers_;
};

}  // namespace tenon::test
