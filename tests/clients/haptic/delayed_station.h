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

/// A server, and what of it reaches the station of the right hand `delay` ticks away. The left hand is at the
/// server.
class DelayedServer {
 public:
  DelayedServer(const std::shared_ptr<const simulation::Scene>& scene, Tick delay,
                const StationAnswers& answers)
      : environment_(scene, {}), delay_(delay), answers_(answers) {
    std::vector<SceneObject> objects(scene->objects.size());
    for (std::uint32_t i = 0; i < objects.size(); ++i) {
      objects[i].object = ObjectId{i};
      if (scene->objects[i].structures) objects[i].size = scene->objects[i].structures->info.box_M.sizes();
    }
    world_.begin(objects, 0, 0);
    for (std::uint32_t i = 0; i < scene->hands.size(); ++i) environment_.setHandPresent(HandId{i}, true);
  }

  /// Begins a millisecond at the station: frames that have come are in world(), manifolds go to `take`.
  /// Returns the number of the input that the station reads.
  template <class Take>
  std::uint32_t deliver(Take take) {
    ++now_;
    for (; !frames_.empty() && frames_.front().tick + delay_ < now_; frames_.pop_front())
      world_.receive(frames_.front());
    const Tick late = delay_ + answers_.manifolds_later;
    for (; !manifolds_.empty() && manifolds_.front().tick + late < now_; manifolds_.pop_front())
      take(manifolds_.front());
    return static_cast<std::uint32_t>(now_);
  }
  /// The station sends the right hand's input of this millisecond, and the server steps with the left one at
  /// p_WLeft.
  void step(const Pose& X_WRight, const Twist& V_WRight, const Vector3& p_WLeft) {
    inputs_.push_back({static_cast<std::uint32_t>(now_), X_WRight, V_WRight});
    for (; !inputs_.empty() && inputs_.front().seq + delay_ <= now_; inputs_.pop_front()) {
      environment_.setHandPose(kRight, inputs_.front().X_WH, inputs_.front().V_WH);
      answered_ = inputs_.front().seq;
    }
    const Vector3 before = now_ == 1 ? p_WLeft : p_WLeft_;
    environment_.setHandPose(kLeft, Pose(p_WLeft), {(p_WLeft - before) / kTickSeconds, Vector3::Zero()});
    p_WLeft_ = p_WLeft;
    environment_.step();
    if (!is_silent) send();
  }

  [[nodiscard]] simulation::Environment& environment() { return environment_; }
  [[nodiscard]] const haptic::WorldView& world() const { return world_; }

  bool is_silent = false;  ///< its answers are lost

 private:
  void send() {
    WorldFrame frame;
    frame.tick = now_;
    for (std::uint32_t i = 0; i < environment_.objects().size(); ++i) {
      const simulation::ObjectMotion& motion = environment_.objects()[i];
      ObjectState state{ObjectId{i}, motion.epoch, motion.X_WO};
      state.V_WO << motion.V_WO.linear.cast<float>(), motion.V_WO.angular.cast<float>();
      state.status = static_cast<std::uint8_t>(motion.status);
      state.holder = motion.holder;
      frame.states.push_back(state);
    }
    if (now_ % answers_.frame_period == 0) frames_.push_back(frame);
    HandManifold manifold;
    environment_.manifold(kRight, manifold);
    manifold.tick = now_;
    manifold.answers_seq = answered_;
    if (now_ % answers_.manifold_period == 0) manifolds_.push_back(manifold);
  }

  struct Input {
    std::uint32_t seq = 0;
    Pose X_WH;
    Twist V_WH;
  };
  simulation::Environment environment_;
  haptic::WorldView world_;
  std::deque<Input> inputs_;
  std::deque<WorldFrame> frames_;
  std::deque<HandManifold> manifolds_;
  std::uint32_t answered_ = 0;
  Tick now_ = 0;
  Vector3 p_WLeft_ = Vector3::Zero();
  Tick delay_;
  StationAnswers answers_;
};

/// Both force models of the right hand, of a station `delay` ticks from a DelayedServer.
class DelayedStation {
 public:
  explicit DelayedStation(Tick delay, std::shared_ptr<const simulation::Scene> scene = blocks(),
                          const StationAnswers& answers = {})
      : copy(scene), server_(scene, delay, answers) {
    time_.setRoundTrip(2.0 * kTickSeconds * static_cast<double>(delay));
  }

  /// One millisecond with the device of the right hand at p_WH, and the left one at p_WLeft.
  void tick(const Vector3& p_WH, const Vector3& p_WLeft) {
    const std::uint32_t seq =
        server_.deliver([this](const HandManifold& manifold) { local.receive(manifold); });
    if (local.hasManifold()) time_.receive(local.manifold(), seq);
    local.expectAt(time_.known() ? time_.tickOf(seq) : 0.0);
    copy.step(Pose(p_WH), world());
    local.step(Pose(p_WH), world());
    if (local.hasManifold())
      copy.compute(local.manifold(), seq, time_, Pose(p_WH), {}, world(), local.usable(world()));
    server_.is_silent = is_silent;
    server_.step(Pose(p_WH), {}, p_WLeft);
  }

  [[nodiscard]] simulation::Environment& server() { return server_.environment(); }
  [[nodiscard]] const haptic::WorldView& world() const { return server_.world(); }
  /// [N] of the coupling without its damping.
  [[nodiscard]] static Vector3 force(const haptic::LocalProxy& proxy, const Vector3& p_WH) {
    return kStiffness * (proxy.X_WS.translation() - p_WH);
  }

  bool is_silent = false;  ///< the server's answers are lost
  haptic::SceneCopy copy;
  haptic::LocalModel local;

 private:
  DelayedServer server_;
  haptic::ServerTime time_;
};

}  // namespace tenon::test
