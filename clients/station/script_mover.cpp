#include "clients/station/script_mover.h"

namespace tenon::station {

void ScriptMover::begin(std::span<const SceneObject> /*objects*/, std::span<const haptic::MovedHand> hands) {
  steps_ = 0;
  followers_.assign(hands.size(), {});
  for (const HandScript& script : scripts_) {
    for (std::size_t i = 0; i < hands.size(); ++i) {
      if (script.hand.empty() ? i == 0 : script.hand == hands[i].name)
        followers_[i].trajectory = &script.trajectory;
    }
  }
}

void ScriptMover::step(std::span<haptic::MovedHand> hands, const haptic::WorldView& /*world*/) noexcept {
  ++steps_;
  const double t = static_cast<double>(steps_) / 1000.0;
  for (std::size_t i = 0; i < hands.size(); ++i) {
    Follower& follower = followers_[i];
    if (hands[i].hand == nullptr || follower.trajectory == nullptr) continue;
    haptic::HapticHand& hand = *hands[i].hand;
    const Pose X_DI = hand.workspace().toDevice(follower.trajectory->poseAt(t));
    // in a fault the arm waits at the handle, as a person does
    hands[i].intent.X_DI =
        hand.faulty() ? follower.intent.rest(hand.device().X_DH) : follower.intent.towards(X_DI);
    hands[i].intent.contraction = 1.0;
  }
}

}  // namespace tenon::station
