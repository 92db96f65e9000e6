#include "clients/station/tracked_person.h"

#include <utility>

#include "clients/station/tracked_input.h"
#include "devices/catalog.h"
#include "devices/simulated/body_tracker.h"

namespace tenon::station {

namespace {
using devices::TrackedBody;

struct TrackedHand {
  TrackedBody body;
  const char* name;  // of its hand
};
constexpr std::array<TrackedHand, TrackedPerson::kBodies> kTracked{
    TrackedHand{TrackedBody::kForearm, "forearm"}, TrackedHand{TrackedBody::kHead, "head"}};

// [ticks] of a body part's inputs: it feels vibrations, and moves nothing that a hand holds
constexpr std::uint8_t kTrackedPeriod = 4;
}  // namespace

Result<std::unique_ptr<TrackedPerson>> TrackedPerson::open(const std::string& tracker,
                                                           const std::string& tactors,
                                                           haptic::TactileMode mode, std::uint64_t seed) {
  std::unique_ptr<TrackedPerson> person(new TrackedPerson);
  auto opened = devices::openTracker(tracker, {.seed = seed});
  if (!opened) return fail(opened.error().what);
  person->tracker_ = std::move(*opened);
  person->tactile_ = haptic::TactileOptions{mode};
  if (tactors.empty()) return person;
  auto bracelet = devices::openDevice(tactors, {.seed = seed});
  if (!bracelet) return fail(bracelet.error().what);
  person->tactors_ = std::move(*bracelet);
  return person;
}

std::array<std::string, TrackedPerson::kBodies> TrackedPerson::handNames() {
  std::array<std::string, kBodies> names;
  for (std::size_t i = 0; i < kBodies; ++i) names[i] = kTracked[i].name;
  return names;
}

void TrackedPerson::begin(std::span<const HandId> hands, ClientId client, bool armed) {
  for (std::size_t i = 0; i < kBodies; ++i) {
    inputs_[i] = {};
    inputs_[i].hand = hands[i];
    inputs_[i].client = client;
  }
  bracelet_.reset();
  if (!tactors_) return;
  // the session continues without vibration when the bracelet cannot be armed
  bracelet_.emplace(*tactors_, tactile_).begin(hands[0], armed);
}

void TrackedPerson::moveSimulated(const haptic::HapticHand& wearer) noexcept {
  devices::BodyTracker* const simulated = devices::simulatedBodyTracker(*tracker_);
  if (simulated == nullptr) return;
  posture_.step(wearer.pose(), wearer.state().p_WC, kTickSeconds);
  simulated->place(TrackedBody::kForearm, posture_.forearm());
  simulated->place(TrackedBody::kHead, posture_.head());
}

void TrackedPerson::step(std::uint32_t seq, double dt, const haptic::HapticHand* wearer,
                         std::uint32_t server_epoch,
                         FixedVector<DeviceInput, haptic::kMaxStationHands>& inputs,
                         FixedVector<HandState, haptic::kMaxStationHands>& states) noexcept {
  if (wearer != nullptr) moveSimulated(*wearer);
  if (bracelet_) bracelet_->step(seq, dt);
  for (std::size_t i = 0; i < kBodies; ++i) {
    DeviceInput& input = inputs_[i];
    devices::TrackerReading reading;
    tracker_->read(kTracked[i].body, reading);
    if (!input.hand.valid()) continue;
    if (reading.visible) {
      setTrackedPose(input, reading.X_TB, kTickSeconds);
    } else {
      input.active = false;
      input.sample.V_WH = {};
    }
    input.sample.seq = seq;
    input.period = kTrackedPeriod;
    input.server_epoch = server_epoch;
    inputs.push_back(input);
    HandState state;
    state.hand = input.hand;
    state.seq = seq;
    state.X_WH = state.X_WO_local = input.sample.X_WH;
    if (wearer != nullptr) state.p_WC = wearer->state().p_WC;
    if (kTracked[i].body == TrackedBody::kForearm && bracelet_) state.tactors = bracelet_->intensities();
    states.push_back(state);
  }
}

}  // namespace tenon::station
