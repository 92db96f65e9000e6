#include "tests/bench/stability/rig_cell.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

#include "clients/rehearse/rehearsal.h"
#include "devices/simulated/sigma7.h"
#include "tests/clients/rehearse/path_device.h"

namespace tenon::bench {
namespace {

constexpr double kStillTip = 0.5e-3;      // [m]
constexpr double kStillForce = 0.2;       // [N]
constexpr double kHighPass = 5.0;         // [Hz]
constexpr int kLevels = 12;               // of stiffness, each 1/sqrt(2) of the one before
constexpr double kLeastContact = 0.2;     // [N] a smaller mean force is no contact
constexpr double kLeastRotational = 0.1;  // [Nm/rad] that a session takes
constexpr HandStiffness kCarrierStiffness{10'000.0, 1000.0};  // the most that a session takes

/// One hand in one tick.
struct RigSample {
  double t = 0.0;  // [s]
  Vector3 p_DH = Vector3::Zero();
  Vector3 force = Vector3::Zero();  // [N] of the motors on the hand
  bool forces_on = true;
  double coupling = 0.0;  // [N/m] stiffness at the server
};
using RigTrace = std::vector<RigSample>;

/// Butterworth's high pass of second order at kHighPass, for signals at 1 kHz.
class HighPass {
 public:
  Vector3 step(const Vector3& x) {
    const double w = std::tan(std::numbers::pi * kHighPass * kTickSeconds);
    const double norm = 1.0 / (1.0 + std::numbers::sqrt2 * w + w * w);
    const double a1 = 2.0 * (w * w - 1.0) * norm, a2 = (1.0 - std::numbers::sqrt2 * w + w * w) * norm;
    if (first_) x1_ = x2_ = x, first_ = false;
    const Vector3 y = norm * (x - 2.0 * x1_ + x2_) - a1 * y1_ - a2 * y2_;
    x2_ = x1_, x1_ = x, y2_ = y1_, y1_ = y;
    return y;
  }

 private:
  bool first_ = true;
  Vector3 x1_ = Vector3::Zero(), x2_ = Vector3::Zero(), y1_ = Vector3::Zero(), y2_ = Vector3::Zero();
};

devices::SimulatedModel deviceModel(double share) {
  devices::SimulatedModel model = devices::sigma7Model();
  const HandStiffness full = haptic::stiffnessOf(model.caps);
  model.caps.max_stiffness = share * full.translational;
  model.caps.max_rotational_stiffness = std::max(kLeastRotational, share * full.rotational);
  return model;
}

/// All stations of a run, and what their hands do.
class RigRun {
 public:
  RigRun(const RigSituation& situation, RigModel model, const rehearse::LinkConditions& link,
         std::uint64_t seed)
      : situation_(situation), model_(model), link_(link), seed_(seed) {
    options_.needed_hands.emplace();
    traces_.resize(situation.hands.size());
  }

  /// Hands with arms; `share` [-] of the device's stiffness.
  void addArms(double share) {
    for (std::size_t i = 0; i < situation_.hands.size(); ++i) {
      const RigHand& hand = situation_.hands[i];
      auto device = std::make_unique<devices::SimulatedDevice>(deviceModel(share), seed_ + i);
      static_cast<void>(device->open());
      devices::SimulatedDevice* const arm = device.get();
      RigStation* const station =
          add(hand, std::move(device), [arm, &hand](double t) { arm->humanArm().setIntent(hand.intent(t)); });
      samplers_.push_back([arm, station] {
        return RigSample{.p_DH = arm->humanArm().pose().translation(),
                         .force = arm->motorWrench().force,
                         .forces_on = arm->phase() == devices::SimulatedDevice::Phase::kArmed,
                         .coupling = station->coupling()};
      });
    }
    addCarrier([](const RigHand& carrier) { return carrier.intent; });
  }

  /// Devices whose hands move on their given paths, `early` [s] ahead.
  void addPaths(double early) {
    const auto earlier = [early](const HandPath& path) {
      return [&path, early](double t) { return path(t + early); };
    };
    for (const RigHand& hand : situation_.hands) {
      auto device = std::make_unique<test::PathDevice>(deviceModel(1.0), earlier(hand.path));
      test::PathDevice* const path = device.get();
      add(hand, std::move(device), [](double) {});
      samplers_.push_back([path] {
        return RigSample{.p_DH = path->trueNow().translation(), .force = path->motorWrench().force};
      });
    }
    addCarrier([&](const RigHand& carrier) { return earlier(carrier.path); });
  }

  Result<std::vector<RigTrace>> run(double seconds) {
    options_.seconds = seconds;
    std::string refused;
    options_.on_refused = [&](const DeviceInput&, const std::string& why) { refused = why; };
    options_.on_tick = [&](const session::SessionSimulation& simulation, const session::TickInput&,
                           const session::TickOutput&) {
      for (std::size_t i = 0; i < traces_.size(); ++i) {
        RigSample sample = samplers_[i]();
        sample.t = rehearse::secondsAt(simulation.now());
        traces_[i].push_back(sample);
      }
    };
    const auto report = rehearse::runRehearsal(situation_.loaded, std::move(stations_), options_);
    if (!report) return fail(situation_.name + ": " + report.error().what);
    if (!refused.empty()) return fail(situation_.name + ": an input was refused: " + refused);
    return std::move(traces_);
  }

 private:
  RigStation* add(const RigHand& hand, std::unique_ptr<devices::HapticDevice> device,
                  std::function<void(double)> before_step) {
    options_.needed_hands->push_back(situation_.loaded.scene->handNamed(hand.name));
    auto station =
        std::make_unique<RigStation>(hand.name, hand.p_WD, model_, *device, std::move(before_step));
    if (model_ == RigModel::kSceneCopy) station->setCopies(haptic::copiesOf(situation_.compiled, 1));
    RigStation* const added = station.get();
    devices_.push_back(std::move(device));
    stations_.push_back(std::move(station));
    rehearse::LinkConditions link = link_;
    link.seed = 16 * seed_ + stations_.size();
    options_.links.emplace_back(link);
    return added;
  }

  /// Its station is at the server, and its coupling is so stiff that its part is where it wants it.
  template <class PathOf>
  void addCarrier(PathOf pathOf) {
    if (!situation_.carrier) return;
    const RigHand& carrier = *situation_.carrier;
    options_.needed_hands->push_back(situation_.loaded.scene->handNamed(carrier.name));
    auto device = std::make_unique<test::PathDevice>(deviceModel(1.0), pathOf(carrier));
    auto station =
        std::make_unique<RigStation>(carrier.name, carrier.p_WD, RigModel::kManifold, *device, [](double) {});
    station->setStiffness(kCarrierStiffness);
    devices_.push_back(std::move(device));
    stations_.push_back(std::move(station));
    options_.links.emplace_back();
  }

  const RigSituation& situation_;
  RigModel model_;
  rehearse::LinkConditions link_;
  std::uint64_t seed_;
  rehearse::RehearsalOptions options_;
  std::vector<std::unique_ptr<devices::HapticDevice>> devices_;
  std::vector<std::unique_ptr<haptic::Station>> stations_;
  std::vector<std::function<RigSample()>> samplers_;
  std::vector<RigTrace> traces_;
};

struct HeldContact {
  bool stable = false;
  double tip = 0.0, ripple = 0.0, energy = 0.0, mean_force = 0.0, coupling = 0.0;
};

HeldContact judge(const RigTrace& trace) {
  HeldContact held;
  HighPass filter;
  Vector3 least = Vector3::Constant(1e9), most = Vector3::Constant(-1e9), sum = Vector3::Zero();
  double squares = 0.0;
  int count = 0;
  bool on = true;
  for (std::size_t i = 1; i < trace.size(); ++i) {
    const RigSample& sample = trace[i];
    const Vector3 high = filter.step(sample.force);
    on = on && (sample.forces_on || sample.t < kPressAt);
    if (sample.t < kHeldFrom) continue;
    least = least.cwiseMin(sample.p_DH);
    most = most.cwiseMax(sample.p_DH);
    squares += high.squaredNorm();
    sum += sample.force;
    held.energy += sample.force.dot(sample.p_DH - trace[i - 1].p_DH);
    ++count;
  }
  held.tip = (most - least).norm();
  held.ripple = std::sqrt(squares / count);
  held.mean_force = sum.norm() / count;
  held.coupling = trace.back().coupling;
  held.stable = on && held.tip < kStillTip && held.ripple < kStillForce && held.mean_force > kLeastContact;
  return held;
}

Result<std::vector<HeldContact>> hold(const RigSituation& situation, RigModel model,
                                      const rehearse::LinkConditions& link, std::uint64_t seed,
                                      double share) {
  RigRun run(situation, model, link, seed);
  run.addArms(share);
  const auto traces = run.run(kHeldUntil);
  if (!traces) return fail(traces.error().what);
  std::vector<HeldContact> held;
  for (const RigTrace& trace : *traces) held.push_back(judge(trace));
  return held;
}

Result<std::vector<RigSample>> follow(const RigSituation& situation, RigModel model,
                                      const rehearse::LinkConditions& link, std::uint64_t seed,
                                      double early) {
  RigRun run(situation, model, link, seed);
  run.addPaths(early);
  auto traces = run.run(kComparedUntil);
  if (!traces) return fail(traces.error().what);
  return std::move(traces->front());
}

/// [-] of the full stiffness at a level.
double shareOf(int level) { return std::pow(2.0, -0.5 * level); }

}  // namespace

double fullStiffness() { return haptic::stiffnessOf(devices::sigma7Model().caps).translational; }

/// The same path with and without the link, at one phase of its turns; the worst of all stays in `cell`.
Result<void> StabilityRig::compare(const RigSituation& situation, int phase,
                                   const rehearse::LinkConditions& link, RigCell& cell) {
  const double step = kSlowPeriod / situation.phases;
  const double early = situation.phases > 1 ? phase * step + std::fmod(seed_ * kTickSeconds, step) : 0.0;
  std::vector<Vector3>& reference = references_[{situation.name, phase}];
  if (reference.empty()) {
    const auto direct = follow(situation, RigModel::kManifold, {}, seed_, early);
    if (!direct) return fail(direct.error().what);
    for (const RigSample& sample : *direct) reference.push_back(sample.force);
  }
  const auto followed = follow(situation, cell.model, link, seed_, early);
  if (!followed) return fail(followed.error().what);
  double errors = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < followed->size(); ++i) {
    const RigSample& sample = (*followed)[i];
    if (sample.t < kPressed) continue;
    const double error = (sample.force - reference[i]).norm();
    cell.peak_error = std::max(cell.peak_error, error);
    if (!situation.steady(sample.t + early)) continue;
    errors += error * error;
    squares += reference[i].squaredNorm();
  }
  cell.mean_error = std::max(cell.mean_error, std::sqrt(errors / squares));
  return {};
}

Result<RigCell> StabilityRig::measure(const RigSituation& situation, RigModel model, Tick delay,
                                      const RigLoss& loss) {
  RigCell cell{.situation = situation.name, .model = model, .delay = delay, .loss = loss.name};
  const rehearse::LinkConditions link{
      .delay = delay, .jitter = loss.share > 0.0 ? delay / 10 : 0, .loss = loss.share, .burst = loss.burst};

  for (int phase = 0; phase < situation.phases; ++phase)
    if (const auto compared = compare(situation, phase, link, cell); !compared)
      return fail(compared.error().what);

  // ---- an arm that presses
  cell.judged = situation.is_held;
  if (!cell.judged) return cell;
  const auto isStable = [&](int level) -> Result<bool> {
    const auto held = hold(situation, model, link, seed_, shareOf(level));
    if (!held) return fail(held.error().what);
    if (level == 0) {
      const HeldContact& first = held->front();
      cell.tip = first.tip, cell.ripple = first.ripple, cell.energy = first.energy;
      cell.mean_force = first.mean_force, cell.coupling = first.coupling;
      cell.other_share = first.mean_force / std::max(1e-9, held->back().mean_force);
    }
    return std::all_of(held->begin(), held->end(), [](const HeldContact& one) { return one.stable; });
  };
  // the highest of the levels [stable, ...]: those above `unstable` are not, those from `stable` on are
  int unstable = -1, stable = kLevels + 1;
  for (int level : {0, kLevels}) {
    const auto found = isStable(level);
    if (!found) return fail(found.error().what);
    (*found ? stable : unstable) = level;
    if (level == 0 && *found) break;
    if (level == kLevels && !*found) return cell;
  }
  while (stable - unstable > 1) {
    const int level = (stable + unstable) / 2;
    const auto found = isStable(level);
    if (!found) return fail(found.error().what);
    (*found ? stable : unstable) = level;
  }
  cell.stiffness = shareOf(stable) * fullStiffness();
  return cell;
}

}  // namespace tenon::bench
