#include "clients/haptic/station_link.h"

#include <map>
#include <string>
#include <thread>
#include <utility>

namespace tenon::haptic {

namespace {
using std::chrono::milliseconds;

/// "2, 5 and 3 more"
std::string missingOf(const std::map<ObjectId, SceneObject>& objects, std::uint32_t count) {
  constexpr std::size_t kNamed = 8;
  std::string text;
  std::size_t missing = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    if (objects.contains(ObjectId{i})) continue;
    if (++missing <= kNamed) text += (missing > 1 ? ", " : "") + std::to_string(i);
  }
  return missing > kNamed ? text + " and " + std::to_string(missing - kNamed) + " more" : text;
}
}  // namespace

Result<std::unique_ptr<StationLink>> StationLink::open(const wire::MembershipOptions& options,
                                                       const Stop& stop) {
  auto member = wire::Membership::find(options, stop);
  if (!member) return fail(member.error().what);
  std::unique_ptr<StationLink> link(new StationLink());
  link->member_ = std::move(*member);
  Result<void> done = link->member_->join(stop);
  if (done) done = link->member_->watch(link->inbox_);
  if (done) done = link->openWriters();
  if (done) done = link->readScene(options, stop);
  if (!done) return fail(done.error().what);
  return link;
}

Result<void> StationLink::openWriters() {
  wire::Partition& session = member_->session();
  Result<void> opened = openInto(inputs_, session, wire::kDeviceInput);
  if (opened) opened = openInto(states_, session, wire::kHandState100);
  if (opened) opened = openInto(events_, session, wire::kClientEvent);
  if (opened) opened = openInto(telemetry_, session, wire::kTelemetry);
  if (opened) opened = openInto(clock_, session, wire::kClockSync);
  if (opened) opened = openInto(stops_, session, wire::kEmergencyStop);
  return opened;
}

Result<void> StationLink::readScene(const wire::MembershipOptions& options, const Stop& stop) {
  auto reader = wire::Reader<SceneObject>::open(member_->session(), wire::kSceneObject);
  if (!reader) return fail(reader.error().what);
  const auto until = std::chrono::steady_clock::now() + options.timeout;
  const std::uint32_t count = member_->announce().objects;
  std::map<ObjectId, SceneObject> objects;
  SceneObject object;
  while (!stop && objects.size() < count && std::chrono::steady_clock::now() < until) {
    while (reader->take(object))
      if (object.object.value < count) objects[object.object] = object;
    if (objects.size() < count) std::this_thread::sleep_for(milliseconds(5));
  }
  const std::string of_session = " the scene of session '" + member_->sessionName() + "'";
  if (objects.size() < count && stop) return fail("stopped while receiving" + of_session);
  if (objects.size() < count)
    return fail("of the " + std::to_string(count) + " objects of" + of_session + " the server has sent " +
                std::to_string(objects.size()) + " within " + std::to_string(options.timeout.count()) +
                " s; missing: " + missingOf(objects, count) +
                ": check the link (tenon doctor --peer), or give it more time with --wait");
  for (const auto& [id, one] : objects) objects_.push_back(one);
  return {};
}

Result<void> StationLink::awaitMatch(const Stop& stop, const std::function<void()>& meanwhile) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  while (!stop && std::chrono::steady_clock::now() < until) {
    if (inputs_->matchedReaders() > 0 && inbox_.matchedWriters() > 0) return {};
    if (meanwhile) meanwhile();
    std::this_thread::sleep_for(milliseconds(5));
  }
  return fail("the server of session '" + member_->sessionName() + "' does not receive inputs");
}

}  // namespace tenon::haptic
