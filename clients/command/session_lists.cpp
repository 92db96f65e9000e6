#include "clients/command/session_lists.h"

#include <algorithm>
#include <chrono>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "idl/types/names.h"
#include "idl/wire/endpoint.h"

namespace tenon::command {

namespace {
constexpr std::chrono::seconds kPatience{5};
constexpr std::chrono::milliseconds kWait{20};
constexpr std::chrono::milliseconds kStepPatience{1000};
constexpr std::chrono::milliseconds kStatsPatience{200};  // they come each 10 ms

std::string_view markOf(const SessionLists& lists, std::uint32_t step) {
  const bool is_current = lists.current && lists.current->step == step;
  return is_current && lists.current->phase == StepPhase::kActive ? "now" : "";
}

/// What is not there yet; empty: nothing.
std::string missingOf(const SessionLists& lists, const SessionAnnounce& whole) {
  std::vector<std::string> missing;
  const auto count = [&](const char* what, std::size_t have, std::uint32_t all) {
    if (have < all) missing.push_back(fmt::format("{} of {} {}", all - have, all, what));
  };
  count("objects", lists.objects.size(), whole.objects);
  count("hands", lists.hands.size(), whole.hands);
  count("steps", lists.steps.size(), whole.steps);
  return fmt::format("{}", fmt::join(missing, ", "));
}
}  // namespace

std::string SessionLists::text(const std::string& language) const {
  const auto handName = [this](HandId hand) {
    const auto found = hands.find(hand);
    return found == hands.end() ? fmt::format("hand {}", hand.value) : found->second.name;
  };
  std::string text = "people\n";
  for (const auto& [client, person] : people) {
    if (!person.alive) continue;
    std::vector<std::string> moved;
    for (const HandId hand : person.hands) moved.push_back(handName(hand));
    text += fmt::format("  {:<24} {:<12} {}\n", person.name, roleName(person.role), fmt::join(moved, ", "));
  }
  if (unheard > 0) text += fmt::format("  ({} more, not heard of within {} s)\n", unheard, kPatience.count());
  text += "hands\n";
  for (const auto& [id, hand] : hands) {
    const auto own = objects.find(hand.object);
    text += fmt::format(
        "  {:<24} {:<12} {:<24} without input still after {} ms, parked after {} ms{}\n", hand.name,
        roleName(hand.role), own == objects.end() ? "" : own->second.name, hand.limits.freeze_ticks,
        hand.limits.park_ticks,
        hand.guidance_alone
            ? fmt::format("; contacts are not felt, more than {:.0f} ms one way", 1e3 * kLongestContactDelay)
            : "");
  }
  text += "steps\n";
  for (const auto& [index, step] : steps)
    text += fmt::format("  {:>3} {:<20} {:<12} {}\n", index + 1, step.name, markOf(*this, index),
                        localized(step.title, language));
  text += "objects\n";
  for (const auto& [id, object] : objects)
    text += fmt::format("  {:<24} {:<12} {}\n", object.name, object.kind, object.title);
  if (stats)
    text += fmt::format(
        "server\n  late ticks: {}; writes to the bus of more than 5 ms: {}; samples not sent: {}\n",
        stats->late_ticks, stats->slow_writes, stats->unsent_samples);
  return text;
}

Result<SessionLists> readLists(wire::MembershipOptions options, const std::atomic<bool>& stop) {
  options.role = Role::kObserver;
  options.passive = true;
  auto found = wire::Membership::find(options, stop);
  if (!found) return fail(found.error().what);
  wire::Membership& member = **found;
  if (auto joined = member.join(stop); !joined) return fail(joined.error().what);
  SessionLists lists;
  wire::Inbox inbox;
  wire::Partition& session = member.session();
  Result<void> all = member.watch(inbox);
  const auto subscribe = [&]<class M>(const wire::Topic<M>& topic, auto&& receive) {
    if (all) all = inbox.on<M>(session, topic, receive);
  };
  subscribe(wire::kPresence, [&](const Presence& person) { lists.people[person.client] = person; });
  subscribe(wire::kSceneHand, [&](const SceneHand& hand) { lists.hands[hand.hand] = hand; });
  subscribe(wire::kSceneObject, [&](const SceneObject& object) { lists.objects[object.object] = object; });
  subscribe(wire::kSceneStep, [&](const SceneStep& step) { lists.steps[step.step] = step; });
  subscribe(wire::kStepState, [&](const StepState& step) { lists.current = step; });
  if (!all) return fail(all.error().what);
  // apart from the lists, which end when they are complete
  auto stats = wire::Reader<TickStats>::open(session, wire::kTickStats100);
  if (!stats) return fail(stats.error().what);

  const auto until = std::chrono::steady_clock::now() + kPatience;
  const SessionAnnounce& whole = member.announce();
  const auto awaitsPeople = [&] {
    // who has left meanwhile was there
    return lists.people.size() < member.welcome().people;
  };
  while (!stop && (!missingOf(lists, whole).empty() || awaitsPeople()) &&
         std::chrono::steady_clock::now() < until)
    inbox.dispatch(kWait);
  // before the run there is none
  const auto until_step = std::min(until, std::chrono::steady_clock::now() + kStepPatience);
  while (!stop && !lists.current && std::chrono::steady_clock::now() < until_step) inbox.dispatch(kWait);
  if (awaitsPeople())
    lists.unheard = member.welcome().people - static_cast<std::uint32_t>(lists.people.size());
  if (const std::string missing = missingOf(lists, whole); !missing.empty())
    return fail(
        fmt::format("session '{}' has not sent all of its lists within {} s; missing: {}: try again, "
                    "or check the link (tenon doctor --peer)",
                    member.sessionName(), kPatience.count(), missing));
  // a server that waits for its clients sends none
  const auto until_stats = std::min(until, std::chrono::steady_clock::now() + kStatsPatience);
  for (TickStats newest; !stop && !lists.stats && std::chrono::steady_clock::now() < until_stats;) {
    if (stats->take(newest))
      lists.stats = newest;
    else
      inbox.dispatch(kWait);
  }
  return lists;
}

}  // namespace tenon::command
