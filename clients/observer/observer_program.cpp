#include "clients/observer/observer_program.h"

#include <chrono>
#include <utility>

#include "idl/wire/endpoint.h"

namespace tenon::observer {

namespace {
using Clock = Timeline::Clock;
constexpr std::chrono::milliseconds kDelay{300};  // messages of one tick arrive within it
constexpr std::chrono::seconds kLongestEnd{2};
}  // namespace

Result<void> observeSession(Observer& observer, wire::MembershipOptions options,
                            const std::atomic<bool>& stop) {
  options.role = Role::kObserver;
  options.passive = true;
  auto found = wire::Membership::find(options, stop);
  if (!found) return fail(found.error().what);
  wire::Membership& member = **found;
  if (auto joined = member.join(stop); !joined) return joined;

  wire::Inbox inbox;
  Result<void> all = member.watch(inbox);
  const auto subscribe = [&]<class M>(const wire::Topic<M>& topic) {
    if (!all) return;
    all = inbox.on<M>(member.session(), topic, [&observer](const M& message) { observer.receive(message); });
  };
  subscribe(wire::kSceneObject);
  subscribe(wire::kGrabState);
  subscribe(wire::kPresence);
  subscribe(wire::kStepState);
  subscribe(wire::kStepProgress);
  subscribe(wire::kContactPairs100);
  subscribe(wire::kEventLog);
  subscribe(wire::kEmergencyStop);
  subscribe(wire::kEmergencyClear);
  subscribe(wire::kRunState);
  if (!all) return all;
  while (!stop && !observer.over() && !member.lost()) {
    inbox.dispatch(std::chrono::milliseconds(100));
    observer.printReceivedBefore(Clock::now() - kDelay);
    if (!member.lost() || observer.over()) continue;
    // another server may resume the session; one that took this program for dead has a seat for it
    const std::string why = *member.lost();
    if (auto back = member.rejoin(stop, [&] { inbox.dispatch(std::chrono::milliseconds(0)); }); !back)
      return fail(why + "; " + back.error().what);
  }
  // the last messages of other topics may arrive after the end of the run
  const auto until = Clock::now() + kLongestEnd;
  while (!stop && Clock::now() < until && inbox.dispatch(kDelay) > 0) {
  }
  observer.printAll();
  return {};
}

}  // namespace tenon::observer
