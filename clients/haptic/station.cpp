#include "clients/haptic/station.h"

#include <algorithm>
#include <cstdio>

#include "clients/haptic/haptic_hand.h"
#include "devices/device.h"
#include "devices/safety_rules.h"
#include "idl/types/messages/timing.h"

namespace tenon::haptic {

namespace {
constexpr double kLongestKnown = 10.0;  // [s] delay of a link, one way

std::string describeSafety(const StationEvent& event) {
  const std::string rule = devices::toString(static_cast<devices::SafetyRule>(event.detail));
  char number[32];
  if (event.kind == StationEventKind::kSafetyEnded) {
    std::snprintf(number, sizeof number, "%.2f s", event.value);
    return "safety: " + rule + " ended, active for " + number;
  }
  std::snprintf(number, sizeof number, "%.1f N", event.value);
  const std::string more =
      event.count > 0 ? ", " + std::to_string(event.count) + " earlier not reported" : "";
  return "safety: " + rule + " (" + number + " requested" + more + ")";
}

}  // namespace

std::string describe(const StationEvent& event, const std::string& hand_name) {
  const std::string hand = "hand " + hand_name;
  const std::string times = event.count > 1 ? ", " + std::to_string(event.count) + " times" : "";
  const std::string when = ", step " + std::to_string(event.seq);
  const auto milliseconds = [&event] { return std::to_string(static_cast<int>(event.value)) + " ms"; };
  switch (event.kind) {
    case StationEventKind::kSafetyBegan:
    case StationEventKind::kSafetyEnded:
      return hand + ": " + describeSafety(event) + when;
    case StationEventKind::kDeviceFault:
      return hand + ": device fault: " + devices::toString(static_cast<devices::DeviceFault>(event.detail)) +
             when;
    case StationEventKind::kIndexingBegan:
      return hand + ": indexing started" + times + when;
    case StationEventKind::kIndexingEnded:
      return hand + ": indexing stopped" + times + when;
    case StationEventKind::kBeyondValidity:
      return hand + ": ahead of the contact set (" + milliseconds() + " in total)" + times + when;
    case StationEventKind::kStale:
      return hand + ": contacts are " + milliseconds() +
             " old, more than the link explains: the force fades" + times + when;
    case StationEventKind::kServerChanged:
      return "server restarted, epoch " + std::to_string(event.detail) + when;
    case StationEventKind::kStopChanged:
      return (event.detail != 0 ? "emergency stop engaged" : "emergency stop released") + when;
    case StationEventKind::kArmed:
      return "armed by the person at the station" + when;
    case StationEventKind::kGuidanceBegan:
      return hand + ": guided by a virtual fixture" + when;
    case StationEventKind::kGuidanceEnded:
      return hand + ": guidance ended" + when;
    case StationEventKind::kGuidanceAlone:
      return "contacts are not felt over this link: " + milliseconds() + " one way, " +
             std::to_string(static_cast<int>(1e3 * kLongestContactDelay)) +
             " ms at most; guidance continues" + when;
    case StationEventKind::kContactsAgain:
      return "contacts are felt again: " + milliseconds() + " one way" + when;
  }
  return "unknown event" + when;
}

std::string describe(const HandDevice& device) {
  char radius[32];
  std::snprintf(radius, sizeof radius, "%.3f m", device.workspace_radius);
  const std::string serial = device.serial.empty() ? "" : ", serial number " + device.serial;
  return "hand " + device.hand + ": " + device.model + serial + ", workspace radius " + radius;
}

std::string Station::describe(const StationEvent& event) const {
  const auto found = std::find(hand_ids_.begin(), hand_ids_.end(), event.hand);
  if (!event.hand.valid() || found == hand_ids_.end())
    return tenon::haptic::describe(event, std::to_string(event.hand.value));
  return tenon::haptic::describe(event, handNames()[static_cast<std::size_t>(found - hand_ids_.begin())]);
}

void Station::welcome(const Welcome& welcome, std::span<const SceneObject> objects) {
  client_ = welcome.client;
  objects_.assign(objects.begin(), objects.end());
  world_.begin(objects, welcome.server_epoch, welcome.tick);
  std::vector<HandId> ids = welcome.hands;
  ids.resize(handNames().size());
  hand_ids_ = ids;
  hand_objects_ = welcome.objects;
  hand_objects_.resize(ids.size());
  own_hands_.clear();
  for (const HandId id : ids) {
    if (id.valid()) own_hands_.push_back(id);
  }
  begin(ids);
}

void Station::receive(const WorldFrame& frame) noexcept {
  const std::uint32_t epoch = world_.serverEpoch();
  if (world_.receive(frame) && world_.serverEpoch() != epoch) {
    report(StationEventKind::kServerChanged, {}, world_.serverEpoch(), 0.0);
  }
}

bool Station::isOwn(HandId hand) const noexcept {
  return std::find(own_hands_.begin(), own_hands_.end(), hand) != own_hands_.end();
}

bool Station::receive(const HandManifold& manifold) noexcept {
  if (!isOwn(manifold.hand)) return false;
  manifoldReceived(manifold);
  return true;
}

bool Station::receive(const Guidance& guidance) noexcept {
  if (!isOwn(guidance.hand)) return false;
  guidanceReceived(guidance);
  return true;
}

void Station::receive(const StepState& step) {
  step_ = step;
  stepChanged();
}

void Station::receive(const StopSignal& stop) noexcept {
  const bool stopped = arming_.stopped();
  const bool permitted = arming_.permitsForces();
  arming_.receive(stop);
  if (arming_.stopped() && !stopped) report(StationEventKind::kStopChanged, {}, 1, 0.0);
  updateArming(permitted);
}

void Station::press() noexcept {
  const bool permitted = arming_.permitsForces();
  if (arming_.awaitsPress()) report(StationEventKind::kArmed, {}, 0, 0.0);
  arming_.press();
  updateArming(permitted);
  if (permitted) armingChanged();
}

void Station::updateArming(bool permitted_before) noexcept {
  if (arming_.release()) report(StationEventKind::kStopChanged, {}, 0, 0.0);
  if (arming_.permitsForces() != permitted_before) armingChanged();
}

void Station::pressLikeAPerson(bool fault) noexcept {
  constexpr std::uint32_t kReaction = 500;     // [steps]
  constexpr std::uint32_t kInspection = 2000;  // [steps]
  unpressed_ = arming_.awaitsPress() ? unpressed_ + 1 : 0;
  faulty_ = fault ? faulty_ + 1 : 0;
  if (unpressed_ < kReaction && faulty_ < kInspection) return;
  faulty_ = 0;
  press();
}

bool Station::takeEvent(StationEvent& event) noexcept {
  if (events_taken_ == events_written_) return false;
  event = events_[events_taken_ % kEventCapacity];
  ++events_taken_;
  return true;
}

void Station::report(const HapticHand& hand) noexcept {
  const HandEvents& events = hand.events();
  for (const devices::Intervention& intervention : events.interventions) {
    const double value = intervention.began ? intervention.requested_force
                                            : static_cast<double>(intervention.active_ticks) * kTickSeconds;
    report(intervention.began ? StationEventKind::kSafetyBegan : StationEventKind::kSafetyEnded, hand.id(),
           devices::bit(intervention.rule), value, intervention.unreported);
  }
  if (events.fault_began) {
    report(StationEventKind::kDeviceFault, hand.id(), static_cast<std::uint32_t>(hand.device().fault), 0.0);
  }
  if (events.indexing_began) report(StationEventKind::kIndexingBegan, hand.id(), 0, 0.0);
  if (events.indexing_ended) report(StationEventKind::kIndexingEnded, hand.id(), 0, 0.0);
  if (events.stale_began) report(StationEventKind::kStale, hand.id(), 0, hand.state().manifold_age);
  if (events.guidance_alone_began)
    report(StationEventKind::kGuidanceAlone, hand.id(), 0, 1e3 * std::min(hand.linkDelay(), kLongestKnown));
  if (events.guidance_alone_ended)
    report(StationEventKind::kContactsAgain, hand.id(), 0, 1e3 * hand.linkDelay());
  if (events.guidance_began) report(StationEventKind::kGuidanceBegan, hand.id(), 0, 0.0);
  if (events.guidance_ended) report(StationEventKind::kGuidanceEnded, hand.id(), 0, 0.0);
  if (events.beyond_validity_began) {
    const auto ticks = static_cast<double>(hand.beyondValidity());
    report(StationEventKind::kBeyondValidity, hand.id(), 0, ticks);
  }
}

void Station::report(StationEventKind kind, HandId hand, std::uint32_t detail, double value,
                     std::uint32_t count) noexcept {
  events_[events_written_ % kEventCapacity] = {seq_, kind, hand, detail, value, count, world_.tick()};
  ++events_written_;
  if (events_written_ - events_taken_ > kEventCapacity) events_taken_ = events_written_ - kEventCapacity;
}

const SceneObject* Station::sceneObject(ObjectId object) const {
  for (const SceneObject& candidate : objects_) {
    if (candidate.object == object) return &candidate;
  }
  return nullptr;
}

}  // namespace tenon::haptic
