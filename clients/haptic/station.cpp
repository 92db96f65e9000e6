#include "clients/haptic/station.h"

#include <algorithm>
#include <cstdio>

#include "clients/haptic/haptic_hand.h"
#include "devices/device.h"
#include "devices/safety_rules.h"

namespace tenon {

namespace {

std::string safetySentence(const StationEvent& event) {
  const std::string rule = toString(static_cast<SafetyRule>(event.detail));
  char number[32];
  if (event.kind == StationEventKind::kSafetyEnded) {
    std::snprintf(number, sizeof number, "%.2f s", event.value);
    return "safety: " + rule + ": ended, acted for " + number;
  }
  std::snprintf(number, sizeof number, "%.1f N", event.value);
  const std::string more = event.count > 0 ? ", " + std::to_string(event.count) + " times more before" : "";
  return "safety: " + rule + " (" + number + " were wanted" + more + ")";
}

}  // namespace

std::string describe(const StationEvent& event, const std::string& hand_name) {
  const std::string hand = "hand " + hand_name;
  const std::string when = " at " + std::to_string(event.seq);
  switch (event.kind) {
    case StationEventKind::kSafetyBegan:
    case StationEventKind::kSafetyEnded:
      return hand + ": " + safetySentence(event) + when;
    case StationEventKind::kDeviceFault:
      return hand + ": the device reports a fault: " + toString(static_cast<DeviceFault>(event.detail)) +
             when;
    case StationEventKind::kIndexingBegan:
      return hand + ": the workspace begins to move" + when;
    case StationEventKind::kIndexingEnded:
      return hand + ": the workspace stands still" + when;
    case StationEventKind::kBeyondValidity:
      return hand + ": moved beyond what the server's contacts cover" + when;
    case StationEventKind::kStale:
      return hand + ": no contacts heard for " + std::to_string(static_cast<int>(event.value)) + " ms" + when;
    case StationEventKind::kServerChanged:
      return "the server began a new life, epoch " + std::to_string(event.detail) + when;
    case StationEventKind::kStopChanged:
      return (event.detail != 0 ? "emergency stop" : "emergency stop released") + when;
  }
  return "unknown event" + when;
}

std::string Station::describe(const StationEvent& event) const {
  const auto found = std::find(hand_ids_.begin(), hand_ids_.end(), event.hand);
  if (!event.hand.valid() || found == hand_ids_.end())
    return tenon::describe(event, std::to_string(event.hand.value));
  return tenon::describe(event, handNames()[static_cast<std::size_t>(found - hand_ids_.begin())]);
}

void Station::welcome(const Welcome& welcome, std::span<const SceneObject> objects) {
  client_ = welcome.client;
  objects_.assign(objects.begin(), objects.end());
  world_.begin(objects, welcome.server_epoch, welcome.tick);
  std::vector<HandId> ids = welcome.hands;
  ids.resize(handNames().size());
  hand_ids_ = ids;
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

void Station::receive(const HandManifold& manifold) noexcept {
  if (std::find(own_hands_.begin(), own_hands_.end(), manifold.hand) != own_hands_.end()) heard(manifold);
}

void Station::receive(const StepState& step) {
  step_ = step;
  stepChanged();
}

void Station::receive(const EmergencyStop& stop) {
  report(StationEventKind::kStopChanged, {}, stop.engaged ? 1U : 0U, 0.0);
  stopChanged(stop.engaged);
}

void Station::receive(const GrabState& /*grab*/) {
  // what a hand moves is in its manifold, together with the planes that fit it
}

bool Station::takeEvent(StationEvent& event) noexcept {
  if (events_taken_ == events_written_) return false;
  event = events_[events_taken_ % kEventRoom];
  ++events_taken_;
  return true;
}

void Station::report(const HapticHand& hand) noexcept {
  const HandNews& news = hand.news();
  for (const Intervention& told : news.interventions) {
    const double value = told.began ? told.before : static_cast<double>(told.acted) * kTickSeconds;
    report(told.began ? StationEventKind::kSafetyBegan : StationEventKind::kSafetyEnded, hand.id(),
           bit(told.rule), value, told.untold);
  }
  if (news.fault_began) {
    report(StationEventKind::kDeviceFault, hand.id(), static_cast<std::uint32_t>(hand.device().fault), 0.0);
  }
  if (news.indexing_began) report(StationEventKind::kIndexingBegan, hand.id(), 0, 0.0);
  if (news.indexing_ended) report(StationEventKind::kIndexingEnded, hand.id(), 0, 0.0);
  if (news.stale_began) report(StationEventKind::kStale, hand.id(), 0, hand.local().proxy().age);
  if (news.beyond_validity_began) {
    const auto ticks = static_cast<double>(hand.local().beyondValidity());
    report(StationEventKind::kBeyondValidity, hand.id(), 0, ticks);
  }
}

void Station::report(StationEventKind kind, HandId hand, std::uint32_t detail, double value,
                     std::uint32_t count) noexcept {
  events_[events_written_ % kEventRoom] = {seq_, kind, hand, detail, value, count};
  ++events_written_;
  if (events_written_ - events_taken_ > kEventRoom) events_taken_ = events_written_ - kEventRoom;
}

const SceneObject* Station::sceneObject(ObjectId object) const {
  for (const SceneObject& candidate : objects_) {
    if (candidate.object == object) return &candidate;
  }
  return nullptr;
}

}  // namespace tenon
