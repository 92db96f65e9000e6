#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "clients/haptic/haptic_hand.h"
#include "clients/rehearse/rehearsal.h"
#include "devices/safety_rules.h"
#include "devices/simulated/falcon.h"
#include "devices/simulated/hug.h"
#include "devices/simulated/omega3.h"
#include "devices/simulated/sigma7.h"
#include "tests/clients/rehearse/path_device.h"

// Hands as stiff as their devices allow, through all that a session has between a device and a contact:
// encoders, input, the server's tick, manifold, local model, coupling, safety layer, the device's delay, and
// the hold of one period. The hand has no tremor: it moves along a path.
//
//   device  path --.         station: HapticHand        server: SessionSimulation
//           |-----o|-->  encoder --> input ------------> registry, tick
//           |  motor <-- safety <-- local model <------- manifold, one tick later

namespace tenon::test {

struct Make {
  const char* name;
  devices::SimulatedModel (*model)();
};
inline void PrintTo(const Make& make, std::ostream* out) { *out << make.name; }
inline constexpr Make kHug{"hug", devices::hugArmModel};
inline constexpr Make kSigma{"sigma7", devices::sigma7Model};
inline constexpr Make kOmega{"omega3", devices::omega3Model};
inline constexpr Make kFalcon{"falcon", devices::falconModel};

/// One hand, whose device follows a path, with the safety layer that a station has.
class PathStation final : public haptic::Station {
 public:
  PathStation(const devices::SimulatedModel& model, PathDevice::Path path, const Vector3& p_WH)
      : device(model, std::move(path)), p_WH_(p_WH) {}

  [[nodiscard]] std::vector<std::string> handNames() const override { return {"right"}; }
  [[nodiscard]] std::vector<HandStiffness> stiffness() const override {
    return {haptic::stiffnessOf(device.caps())};
  }
  [[nodiscard]] Role role() const override { return Role::kTrainee; }
  [[nodiscard]] Result<void> armDevices() override { return {}; }
  void step(std::uint32_t seq) noexcept override {
    hand.step(seq, world_, dt_);
    inputs_.clear();
    inputs_.push_back(hand.input());
  }
  /// True pose of the hand in the scene.
  [[nodiscard]] Pose X_WH() { return hand.workspace().toWorld(device.trueNow()); }

  PathDevice device;
  haptic::HapticHand hand{device};

 protected:
  void begin(std::span<const HandId> hands) override {
    hand.begin(hands.front(), client_, p_WH_, true);
    EXPECT_TRUE(hand.armDevice());
    hand.handBack();
  }
  void manifoldReceived(const HandManifold& manifold) noexcept override { hand.receive(manifold); }
  void armingChanged() noexcept override {}

 private:
  Vector3 p_WH_;
};

/// A session of one hand that holds an object.
struct HeldObject {
  session::LoadedScene loaded;
  ObjectId object;
  Pose X_WO;                            ///< where it touches, with the hand's frame at the object's
  Vector3 normal_W = Vector3::UnitZ();  ///< of the contact, on the object
};

inline constexpr double kHover = 0.01;  // [m] before the contact, where it begins
inline constexpr double kWait = 1.5;    // [s] the soft start is over, the hand's offset has decayed
inline constexpr double kArrive = 0.5;  // [s] from there to the begin of the loop

/// What a hand did, per tick from the begin of its loop on.
struct HandTick {
  double t;              // [s] since then
  Pose X_WH, X_WO;       // true pose of the hand; server's pose of the object
  Pose X_WO_local;       // the local model's
  Wrench motor;          // in the period that ended at t
  double given, damped;  // [J] until t
};

/// The hand goes to `loop(0)`, relative to the pose of contact, and follows `loop` for `seconds` [s].
inline std::vector<HandTick> follow(const Make& make, const HeldObject& held, const PathDevice::Path& loop,
                                    double seconds) {
  const devices::SimulatedModel model = make.model();
  const auto path = [&](double t) -> Pose {
    if (t > kWait + kArrive) return loop(t - kWait - kArrive);
    const Pose X = loop(0.0);
    const double s = std::clamp((t - kWait) / kArrive, 0.0, 1.0);
    const double share = s * s * s * (10.0 + s * (6.0 * s - 15.0));
    return {share * X.translation() + (1.0 - share) * kHover * held.normal_W,
            expRotation(share * logRotation(X.rotation()))};
  };
  const Vector3 p_WContact = held.X_WO.translation();
  auto owned = std::make_unique<PathStation>(
      model, [&](double t) { return Pose(path(t).translation(), path(t).rotation() * held.X_WO.rotation()); },
      p_WContact + kHover * held.normal_W);
  PathStation& station = *owned;
  std::vector<HandTick> samples;
  rehearse::RehearsalOptions options;
  options.seconds = kWait + kArrive + seconds;
  options.needed_hands = {HandId{0}};
  options.takes = {{HandId{0}, held.object}};
  options.on_refused = [](const DeviceInput&, const std::string& why) { ADD_FAILURE() << why; };
  options.on_tick = [&](const session::SessionSimulation& simulation, const session::TickInput&,
                        const session::TickOutput&) {
    if (station.device.now() < kWait + kArrive) return;
    samples.push_back({station.device.now() - kWait - kArrive, station.X_WH(),
                       simulation.environment().objects()[held.object.value].X_WO,
                       station.hand.state().X_WO_local, station.device.motorWrench(), station.device.given(),
                       station.device.damped()});
  };
  std::vector<std::unique_ptr<haptic::Station>> stations;
  stations.push_back(std::move(owned));
  const auto report = rehearse::runRehearsal(held.loaded, std::move(stations), options);
  if (!report) ADD_FAILURE() << report.error().what;
  return samples;
}

/// Slope of y over x by least squares.
inline double slopeOf(const std::vector<double>& x, const std::vector<double>& y) {
  double sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
  const auto n = static_cast<double>(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) sx += x[i], sy += y[i], sxx += x[i] * x[i], sxy += x[i] * y[i];
  return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

inline double rangeOf(const std::vector<double>& x) {
  const auto [least, most] = std::minmax_element(x.begin(), x.end());
  return *most - *least;
}

}  // namespace tenon::test
