#include "server/session/mentoring.h"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include "server/game_control/state_machine.h"
#include "server/session/rights.h"

namespace tenon::session {
namespace {

constexpr Tick kOffRepeatTicks = 200;  // [ticks] for which the end of a guidance is repeated

std::vector<std::string_view> split(std::string_view words) {
  std::vector<std::string_view> all;
  while (!words.empty()) {
    const std::size_t space = std::min(words.find(' '), words.size());
    if (space > 0) all.push_back(words.substr(0, space));
    words.remove_prefix(std::min(space + 1, words.size()));
  }
  return all;
}

/// The hand is heard, and what it holds is not held still.
bool isLive(const TickOutput& output, HandId hand) {
  return output.present[hand.value] && output.ages[hand.value] <= Mentoring::kSilent &&
         output.manifolds[hand.value].object.valid() && !output.manifolds[hand.value].frozen;
}

/// Where the hand's object is seen: outside of what it touches.
Pose seenPose(const TickOutput& output, HandId hand) {
  const HandManifold& manifold = output.manifolds[hand.value];
  return manifold.X_WO * manifold.X_HO.inverse();
}

tl::unexpected<Refused> expectedUsage() {
  return refuse(Refusal::kOther, fmt::format("expected: guide {}", mentoringUsage()));
}

/// A frame whose z is the unit vector `z_W`.
Quaternion frameAlong(const Vector3& z_W) { return Quaternion::FromTwoVectors(Vector3::UnitZ(), z_W); }

}  // namespace

std::string_view mentoringUsage() noexcept {
  return "show|resist HAND [hand|pose|axis|plane|tube] [by HAND], together HAND [by HAND], record [HAND], "
         "path HAND "
         "[pose] [by HAND], off [HAND]";
}

std::vector<std::string> Mentoring::handsOf(Role role) const {
  std::vector<std::string> names;
  for (const game_control::ScenarioHand& hand : scenario_.hands)
    if (hand.role == role && hand.kind == simulation::HandKind::kCoupled) names.push_back(hand.name);
  return names;
}

tl::expected<HandId, Refused> Mentoring::guideOf(std::string_view name, std::string_view otherwise,
                                                 ClientId client,
                                                 std::span<const ClientId> controllers) const {
  if (!name.empty()) {
    const HandId hand = scenario_.handNamed(name);
    if (!hand.valid() || scenario_.hands[hand.value].role != Role::kInstructor)
      return refuse(Refusal::kUnknownName, inQuotes(name) + " is no hand of an instructor in this scenario" +
                                               namesInstead(handsOf(Role::kInstructor)));
    if (!controllers[hand.value].valid())
      return refuse(Refusal::kNobodyThere, fmt::format("nobody moves hand '{}'", name));
    return hand;
  }
  std::vector<HandId> own, all;
  for (std::uint32_t i = 0; i < controllers.size(); ++i) {
    const game_control::ScenarioHand& hand = scenario_.hands[i];
    if (hand.role != Role::kInstructor || hand.kind != simulation::HandKind::kCoupled ||
        !controllers[i].valid())
      continue;
    all.push_back(HandId{i});
    if (controllers[i] == client) own.push_back(HandId{i});
  }
  const std::vector<HandId>& candidates = own.empty() ? all : own;
  if (candidates.empty())
    return refuse(Refusal::kNobodyThere,
                  "no instructor moves a hand: join as instructor with a device first");
  if (candidates.size() > 1)
    return refuse(Refusal::kUnknownName, fmt::format("several hands could guide: add '{}{}' or another one",
                                                     otherwise, nameOf(candidates[0])));
  return candidates[0];
}

tl::expected<Mentoring::Choice, Refused> Mentoring::parse(std::string_view words, ClientId client,
                                                          std::span<const ClientId> controllers) const {
  const auto usage = [] { return expectedUsage(); };
  std::vector<std::string_view> all = split(words);
  std::string_view by;
  if (all.size() >= 2 && all[all.size() - 2] == "by") {
    by = all.back();
    all.resize(all.size() - 2);
  }
  if (all.size() < 2 || all.size() > 3) return usage();
  Choice choice;
  choice.hand = scenario_.handNamed(all[1]);
  if (!choice.hand.valid() || scenario_.hands[choice.hand.value].role != Role::kTrainee ||
      scenario_.hands[choice.hand.value].kind != simulation::HandKind::kCoupled)
    return refuse(Refusal::kUnknownName,
                  inQuotes(all[1]) + " is no hand of a trainee that displays forces in this scenario" +
                      namesInstead(handsOf(Role::kTrainee)));
  choice.hand_client = controllers[choice.hand.value];
  if (!choice.hand_client.valid())
    return refuse(Refusal::kNobodyThere, fmt::format("nobody moves hand '{}'", all[1]));

  choice.mutual = all[0] == "together";
  choice.follows_path = all[0] == "path";
  if (all[0] == "resist") choice.mode = GuidanceMode::kResist;
  const bool is_known = all[0] == "show" || all[0] == "resist" || choice.mutual || choice.follows_path;
  if (!is_known || (choice.mutual && all.size() == 3)) return usage();
  if (choice.follows_path && all.size() == 3 && all[2] != "pose") return usage();
  constexpr std::array kKinds{std::pair{"axis", FixtureKind::kAxis}, std::pair{"plane", FixtureKind::kPlane},
                              std::pair{"tube", FixtureKind::kTube}, std::pair{"pose", FixtureKind::kPose},
                              std::pair{"hand", FixtureKind::kPose}};
  const std::string_view kind = all.size() == 3 ? all[2] : "hand";
  const auto* const named =
      std::find_if(kKinds.begin(), kKinds.end(), [&](const auto& known) { return kind == known.first; });
  if (named == kKinds.end()) return usage();
  choice.kind = named->second;
  choice.turns = kind == "pose";

  const auto guide = guideOf(by, "by ", client, controllers);
  if (!guide) return tl::unexpected(guide.error());
  choice.guide = *guide;
  choice.guide_client = controllers[choice.guide.value];
  return choice;
}

/// Why the hands are not free for the choice; empty: they are, or it changes what they have already.
tl::expected<void, Refused> Mentoring::conflict(const Choice& choice) const {
  for (const Choice& other : choices_) {
    if (other.hand == choice.hand && other.guide != choice.guide)
      return refuse(Refusal::kAlready,
                    fmt::format("hand '{}' is guided by hand '{}' already: 'guide off {}' ends that",
                                nameOf(choice.hand), nameOf(other.guide), nameOf(choice.hand)));
    if (other.guide == choice.guide && other.hand != choice.hand && (choice.mutual || other.mutual))
      return refuse(Refusal::kAlready,
                    fmt::format("hand '{}' guides hand '{}' already: 'guide off {}' ends that",
                                nameOf(choice.guide), nameOf(other.hand), nameOf(other.hand)));
  }
  return {};
}

tl::expected<void, Refused> Mentoring::decide(std::string_view words, ClientId client, Role role,
                                              std::span<const ClientId> controllers) {
  if (words == "off" || words.starts_with("off ")) return end(words, role);
  if (!has(role, Right::kGuide)) return notPermitted(role);
  if (words == "record" || words.starts_with("record ")) return record(words, client, controllers);
  auto choice = parse(words, client, controllers);
  if (!choice) return tl::unexpected(choice.error());
  if (auto free = conflict(*choice); !free) return free;
  if (choice->follows_path) {
    Path* const path = pathOf(choice->guide);
    if (path == nullptr || path->X_WF.empty())
      return refuse(Refusal::kOther, fmt::format("hand '{}' has recorded no path: 'guide record' first",
                                                 nameOf(choice->guide)));
    path->records = false;
  }
  for (std::size_t i = choices_.size(); i-- > 0;)
    if (choices_[i].hand == choice->hand) erase(i);
  if (choice->mutual) {
    choice->stiffness = mutualStiffness(*choice);
  }
  choice->number = ++numbers_;
  choices_.push_back(*choice);
  return {};
}

void Mentoring::left(ClientId client) {
  for (Choice& choice : choices_)
    choice.is_left = choice.is_left || choice.hand_client == client || choice.guide_client == client;
}

void Mentoring::setRoundTrip(ClientId client, double round_trip) {
  if (round_trip >= 0.0 && round_trip < 10.0) round_trips_[client] = round_trip;
}

double Mentoring::roundTripOf(ClientId client) const {
  const auto known = round_trips_.find(client);
  return known == round_trips_.end() ? kUnknownRoundTrip : known->second;
}

Mentoring::Path* Mentoring::pathOf(HandId guide) {
  const auto found =
      std::find_if(paths_.begin(), paths_.end(), [&](const Path& path) { return path.guide == guide; });
  return found == paths_.end() ? nullptr : &*found;
}

/// From now on, until the path is led along, or for two minutes.
tl::expected<void, Refused> Mentoring::record(std::string_view words, ClientId client,
                                              std::span<const ClientId> controllers) {
  const std::vector<std::string_view> all = split(words);
  if (all.size() > 2) return expectedUsage();
  const auto guide = guideOf(all.size() == 2 ? all[1] : "", "", client, controllers);
  if (!guide) return tl::unexpected(guide.error());
  if (std::any_of(choices_.begin(), choices_.end(),
                  [&](const Choice& choice) { return choice.follows_path && choice.guide == *guide; }))
    return refuse(
        Refusal::kAlready,
        fmt::format("a hand is led along the path of hand '{}': 'guide off' ends that", nameOf(*guide)));
  if (pathOf(*guide) == nullptr) paths_.push_back({.guide = *guide});
  *pathOf(*guide) = {*guide, controllers[guide->value], {}, true};
  return {};
}

/// A path is of the person who moved it.
void Mentoring::updatePaths(const TickOutput& output, std::span<const ClientId> controllers) {
  std::erase_if(paths_, [&](const Path& path) { return controllers[path.guide.value] != path.client; });
  for (Path& path : paths_) {
    if (path.records && path.X_WF.size() < kMostPlaces && isLive(output, path.guide))
      path.X_WF.push_back(seenPose(output, path.guide));
  }
}

/// For trainees too, whose hands are guided: less force than before is nobody's to refuse.
tl::expected<void, Refused> Mentoring::end(std::string_view words, Role role) {
  const std::vector<std::string_view> all = split(words);
  if (!has(role, Right::kActOnOwnHands)) return notPermitted(role);
  if (all.size() > 2) return expectedUsage();
  const HandId hand = all.size() == 2 ? scenario_.handNamed(all[1]) : HandId{};
  if (all.size() == 2 && !hand.valid())
    return refuse(Refusal::kUnknownName,
                  "this scenario has no hand " + inQuotes(all[1]) + namesInstead(handsOf(Role::kTrainee)));
  const std::size_t before = choices_.size();
  for (std::size_t i = choices_.size(); i-- > 0;)
    if (!hand.valid() || choices_[i].hand == hand || choices_[i].guide == hand) erase(i);
  if (choices_.size() < before) return {};
  return refuse(Refusal::kAlready,
                hand.valid() ? fmt::format("hand '{}' is not guided", all[1]) : "no hand is guided");
}

void Mentoring::erase(std::size_t index) {
  ended_since_tick_.push_back(choices_[index].hand);
  if (choices_[index].mutual) ended_since_tick_.push_back(choices_[index].guide);
  choices_.erase(choices_.begin() + static_cast<std::ptrdiff_t>(index));
}

std::string Mentoring::whyEnded(const Choice& choice, const TickOutput& output,
                                std::span<const ClientId> controllers) const {
  if (output.emergency_stop) return "emergency stop";
  if (output.phase >= RunPhase::kSucceeded) return "the run is over";
  if (controllers[choice.guide.value] != choice.guide_client)
    return fmt::format("whoever moved hand '{}' has left", nameOf(choice.guide));
  if (controllers[choice.hand.value] != choice.hand_client)
    return fmt::format("whoever moved hand '{}' has left", nameOf(choice.hand));
  if (choice.is_left) return "whoever moved one of the two hands has left, and is back";
  return {};
}

std::vector<Guidance> Mentoring::step(const TickOutput& output, std::span<const ClientId> controllers,
                                      std::vector<std::string>& ended) {
  for (std::size_t i = choices_.size(); i-- > 0;) {
    const std::string why = whyEnded(choices_[i], output, controllers);
    if (why.empty()) continue;
    ended.push_back(fmt::format("hand '{}' is guided no more: {}", nameOf(choices_[i].hand), why));
    erase(i);
  }
  std::vector<Guidance> fixtures;
  for (const HandId hand : std::exchange(ended_since_tick_, {}))
    ended_.push_back({hand, output.tick + kOffRepeatTicks});
  std::erase_if(ended_, [&](const Ended& one) { return output.tick > one.until; });
  if (output.tick % kPeriod != 0) return fixtures;
  if (!choices_.empty() && step_.revision != output.step.revision)
    step_ = game_control::describe(scenario_, output.step);
  updatePaths(output, controllers);
  for (Choice& choice : choices_) {
    fixtures.push_back(fixtureOf(choice, output));
    if (!choice.mutual) continue;
    Guidance back = fixtures.back();
    std::swap(back.hand, back.guide);
    back.X_WF = seenPose(output, choice.hand);
    fixtures.push_back(back);
  }
  const auto isGuided = [&](HandId hand) {
    return std::any_of(fixtures.begin(), fixtures.end(),
                       [&](const Guidance& one) { return one.hand == hand; });
  };
  for (const Ended& one : ended_) {
    if (isGuided(one.hand)) continue;
    fixtures.push_back({.hand = one.hand, .server_epoch = server_epoch_, .tick = output.tick});
  }
  return fixtures;
}

/// [N/m] As stiff as the round trips permit now.
double Mentoring::mutualStiffness(const Choice& choice) const {
  const double round_trip = roundTripOf(choice.hand_client) + roundTripOf(choice.guide_client);
  return std::min(kMutualStiffness, kMutualDamping / std::max(round_trip, 1e-3));
}

Guidance Mentoring::fixtureOf(Choice& choice, const TickOutput& output) {
  // softer at once, stiffer slowly: a fixture that stiffens under load does work
  constexpr double kStiffening = 2.0;  // [N/m/s]
  if (choice.mutual)
    choice.stiffness =
        std::min(mutualStiffness(choice), choice.stiffness + kStiffening * kTickSeconds * kPeriod);
  Guidance fixture{.hand = choice.hand,
                   .server_epoch = server_epoch_,
                   .tick = output.tick,
                   .choice = choice.number,
                   .mode = choice.mode,
                   .kind = choice.kind,
                   .guide = choice.guide,
                   .stiffness = choice.stiffness,
                   .damping = kDamping};
  bool is_live = isLive(output, choice.hand) && isLive(output, choice.guide);
  if (choice.kind == FixtureKind::kPose) {
    const Path* const path = choice.follows_path ? pathOf(choice.guide) : nullptr;
    fixture.X_WF = path != nullptr ? path->X_WF[choice.place] : seenPose(output, choice.guide);
    // as fast as it was recorded, and no faster than the hand comes along
    const Vector3 p_FH_W = seenPose(output, choice.hand).translation() - fixture.X_WF.translation();
    if (path != nullptr && is_live && p_FH_W.norm() < kLeash && choice.place + 1 < path->X_WF.size())
      ++choice.place;
    if (choice.turns) fixture.rotational_stiffness = kRotationalStiffness;
  } else {
    // where the hand is when what it holds is at the target of the step
    const HandManifold& manifold = output.manifolds[choice.hand.value];
    is_live = is_live && step_.has_target && step_.object == manifold.object && !step_.approach_W.isZero(0.0);
    const Pose X_WH = step_.X_WG * manifold.X_HO.inverse();
    fixture.X_WF = Pose(X_WH.translation(), frameAlong(step_.approach_W));
    fixture.radius = choice.kind == FixtureKind::kTube ? kTubeRadius : 0.0;
    // the fixture of another step is another one
    fixture.choice = choice.number + (step_.step << 16U);
  }
  if (!is_live || !fixture.X_WF.isFinite()) {
    fixture.mode = GuidanceMode::kOff;
    fixture.X_WF = Pose::Identity();
  }
  return fixture;
}

}  // namespace tenon::session
