#include "clients/haptic/station_link.h"

#include <algorithm>
#include <thread>
#include <utility>

namespace tenon::haptic {

namespace {
using std::chrono::milliseconds;
constexpr milliseconds kSceneTimeout{300};  // without a further object the scene is complete

template <class M>
Result<void> openWriter(std::unique_ptr<wire::Writer<M>>& writer, wire::Partition& partition,
                        const wire::Topic<M>& topic) {
  auto opened = wire::Writer<M>::open(partition, topic);
  if (!opened) return fail(opened.error().what);
  writer = std::make_unique<wire::Writer<M>>(std::move(*opened));
  return {};
}
}  // namespace

Result<std::unique_ptr<StationLink>> StationLink::open(const wire::MembershipOptions& wishes,
                                                       const Stop& stop) {
  auto member = wire::Membership::find(wishes, stop);
  if (!member) return fail(member.error().what);
  std::unique_ptr<StationLink> link(new StationLink());
  link->member_ = std::move(*member);
  Result<void> done = link->member_->join(stop);
  if (done) done = link->member_->watch(link->inbox_);
  if (done) done = link->openWriters();
  if (done) done = link->readScene(wishes);
  if (!done) return fail(done.error().what);
  return link;
}

Result<void> StationLink::openWriters() {
  wire::Partition& session = member_->session();
  Result<void> opened = openWriter(inputs_, session, wire::kDeviceInput);
  if (opened) opened = openWriter(states_, session, wire::kHandState100);
  if (opened) opened = openWriter(events_, session, wire::kClientEvent);
  if (opened) opened = openWriter(telemetry_, session, wire::kTelemetry);
  return opened;
}

Result<void> StationLink::readScene(const wire::MembershipOptions& wishes) {
  auto reader = wire::Reader<SceneObject>::open(member_->session(), wire::kSceneObject);
  if (!reader) return fail(reader.error().what);
  const auto until = std::chrono::steady_clock::now() + wishes.timeout;
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
