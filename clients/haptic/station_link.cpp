#include "clients/haptic/station_link.h"

#include <algorithm>
#include <thread>
#include <utility>

namespace tenon::haptic {

namespace {
using std::chrono::milliseconds;
constexpr milliseconds kSceneTimeout{300};  // without a further object the scene is complete
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
  if (done) done = link->readScene(options);
  if (!done) return fail(done.error().what);
  return link;
}

Result<void> StationLink::openWriters() {
  wire::Partition& session = member_->session();
  Result<void> opened = openInto(inputs_, session, wire::kDeviceInput);
  if (opened) opened = openInto(states_, session, wire::kHandState100);
  if (opened) opened = openInto(events_, session, wire::kClientEvent);
  if (opened) opened = openInto(telemetry_, session, wire::kTelemetry);
  if (opened) opened = openInto(stops_, session, wire::kEmergencyStop);
  return opened;
}

Result<void> StationLink::readScene(const wire::MembershipOptions& options) {
  auto reader = wire::Reader<SceneObject>::open(member_->session(), wire::kSceneObject);
  if (!reader) return fail(reader.error().what);
  const auto until = std::chrono::steady_clock::now() + options.timeout;
  auto last = std::chrono::steady_clock::now();
  SceneObject object;
  while (std::chrono::steady_clock::now() < until &&
         (objects_.empty() || std::chrono::steady_clock::now() - last < kSceneTimeout)) {
    while (reader->take(object)) {
      objects_.push_back(object);
      last = std::chrono::steady_clock::now();
    }
    std::this_thread::sleep_for(milliseconds(5));
  }
  if (objects_.empty())
    return fail("the server of session '" + member_->sessionName() + "' sent no objects of its scene");
  std::sort(objects_.begin(), objects_.end(),
            [](const SceneObject& a, const SceneObject& b) { return a.object < b.object; });
  return {};
}

Result<void> StationLink::awaitMatch(const Stop& stop) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  while (!stop && std::chrono::steady_clock::now() < until) {
    if (inputs_->matchedReaders() > 0 && inbox_.matchedWriters() > 0) return {};
    std::this_thread::sleep_for(milliseconds(5));
  }
  return fail("the server of session '" + member_->sessionName() + "' does not receive inputs");
}

}  // namespace tenon::haptic
