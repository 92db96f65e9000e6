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
constexpr std::chrono::milliseconds kQuiet{300};  // without a message the lists are complete

std::string_view markOf(const SessionLists& lists, std::uint32_t step) {
  const bool is_current = lists.current && lists.current->step == step;
  return is_current && lists.current->phase == StepPhase::kActive ? "now" : "";
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
  text += "hands\n";
  for (const auto& [id, hand] : hands) {
    const auto own = objects.find(hand.object);
    text += fmt::format("  {:<24} {:<12} {}\n", hand.name, roleName(hand.role),
                        own == objects.end() ? "" : own->second.name);
  }
  text += "steps\n";
  for (const auto& [index, step] : steps)
    text += fmt::format("  {:>3} {:<20} {:<12} {}\n", index + 1, step.name, markOf(*this, index),
                        localized(step.title, language));
  text += "objects\n";
  for (const auto& [id, object] : objects)
    text += fmt::format("  {:<24} {:<12} {}\n", object.name, object.kind, object.title);
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

  const auto until = std::chrono::steady_clock::now() + kPatience;
  const auto complete = [&] {
    return lists.current && lists.steps.size() == lists.current->steps && !lists.objects.empty() &&
           !lists.hands.empty() && !lists.people.empty();
  };
  while (!stop && (inbox.dispatch(kQuiet) > 0 || !complete()))
    if (std::chrono::steady_clock::now() > until) break;
  if (!complete()) return fail("session '" + member.sessionName() + "' does not send its lists");
  return lists;
}

}  // namespace tenon::command
