#include "clients/observer/observer_program.h"

#include <chrono>
#include <utility>

#include "idl/wire/endpoint.h"

namespace tenon {

Result<void> observe(Observer& observer, MembershipWishes wishes, const std::atomic<bool>& stop) {
  wishes.role = Role::kObserver;
  wishes.only_watches = true;
  auto found = Membership::find(wishes, stop);
  if (!found) return fail(found.error().what);
  Membership& member = **found;
  if (auto joined = member.join(stop); !joined) return joined;

  Inbox inbox;
  Result<void> all = member.watch(inbox);
  const auto listen = [&]<class M>(const Topic<M>& topic) {
    if (!all) return;
    all = inbox.on<M>(member.session(), topic, [&observer](const M& message) { observer.hear(message); });
  };
  listen(kSceneObject);
  listen(kPresence);
  listen(kStepState);
  listen(kStepProgress);
  listen(kContactPairs100);
  listen(kEventLog);
  listen(kEmergencyStop);
  listen(kRunState);
  if (!all) return all;
  while (!stop && !observer.over() && !member.serverIsGone()) inbox.dispatch(std::chrono::milliseconds(100));
  if (member.serverIsGone() && !observer.over()) return fail(*member.lost());
  return {};
}

}  // namespace tenon
