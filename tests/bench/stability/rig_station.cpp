#include "tests/bench/stability/rig_station.h"

#include <utility>

namespace tenon::bench {

RigStation::RigStation(std::string hand, const Vector3& p_WD, RigModel model, devices::HapticDevice& device,
                       std::function<void(double)> before_step)
    : hand_name_(std::move(hand)),
      p_WD_(p_WD),
      model_(model),
      device_(device),
      before_step_(std::move(before_step)),
      hand_(device),
      safety_(device.caps()),
      stiffness_(haptic::stiffnessOf(device.caps())) {}

void RigStation::begin(std::span<const HandId> hands) {
  // the hand's begin() takes the device where it is: there the origin of D is at p_WD
  devices::DeviceState state;
  before_step_(0.0);
  device_.read(state);
  if (model_ == RigModel::kSceneCopy) hand_.setForceModel(haptic::ForceModelKind::kSceneCopy);
  hand_.begin(hands.front(), client_, p_WD_ + state.X_DH.translation(), true);
  static_cast<void>(hand_.armDevice());
  hand_.handBack();
}

void RigStation::manifoldReceived(const HandManifold& manifold) noexcept {
  hand_.receive(manifold);
  if (manifold.tick >= newest_.tick) newest_ = manifold;
}

void RigStation::step(std::uint32_t seq) noexcept {
  before_step_(static_cast<double>(seq) * kTickSeconds);
  inputs_.clear();
  if (model_ == RigModel::kStreamed || model_ == RigModel::kStreamedPassive) return stepStreamed(seq);
  hand_.setLinkJitter(link_jitter_);
  hand_.setLinkRoundTrip(link_round_trip_);
  hand_.step(seq, world_, dt_);
  inputs_.push_back(hand_.input());
}

void RigStation::stepStreamed(std::uint32_t seq) noexcept {
  devices::DeviceState state;
  device_.read(state);
  devices::SafetyRequest request;
  if (newest_.object.valid() && !newest_.frozen) request.requested.F_Ho_D = newest_.F_Ho_W;
  request.stiffness = stiffness_.translational;
  request.rotational_stiffness = stiffness_.rotational;
  const bool passive = model_ == RigModel::kStreamedPassive;
  device_.write(passive ? safety_.step(request, state, dt_) : request.requested);

  DeviceInput input = hand_.input();
  input.server_epoch = world_.serverEpoch();
  input.active = true;
  input.sample = {seq, Pose(p_WD_ + state.X_DH.translation(), state.X_DH.rotation()), state.V_DH, 0};
  inputs_.push_back(input);
}

}  // namespace tenon::bench
