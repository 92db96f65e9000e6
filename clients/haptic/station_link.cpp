#include "clients/haptic/station_link.h"

#include <algorithm>
#include <thread>
#include <utility>

namespace tenon {

namespace {
using std::chrono::milliseconds;
constexpr milliseconds kQuiet{300};  // after the last object of the scene

template <class M>
Result<void> openWriter(std::unique_ptr<Writer<M>>& writer, Partition& partition, const Topic<M>& topic) {
  auto opened = Writer<M>::open(partition, topic);
  if (!opened) return fail(opened.error().what);
  writer = std::make_unique<Writer<M>>(std::move(*opened));
  return {};
}
}  // namespace

Result<std::unique_ptr<StationLink>> StationLink::open(const MembershipWishes& wishes, const Stop& stop) {
  auto member = Membership::find(wishes, stop);
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
  Partition& session = member_->session();
  Result<void> opened = openWriter(inputs_, session, kDeviceInput);
  if (opened) opened = openWriter(states_, session, kHandState100);
  if (opened) opened = openWriter(events_, session, kClientEvent);
  if (opened) opened = openWriter(telemetry_, session, kTelemetry);
  return opened;
}

Result<void> StationLink::readScene(const MembershipWishes& wishes) {
  auto reader = Reader<SceneObject>::open(member_->session(), kSceneObject);
  if (!reader) return fail(reader.error().what);
  const auto until = std::chrono::steady_clock::now() + wishes.patience;
  auto last = std::chrono::steady_clock::now();
  SceneObject object;
  while (std::chrono::steady_clock::now() < until &&
         (objects_.empty() || std::chrono::steady_clock::now() - last < kQuiet)) {
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

Result<void> StationLink::settle(const Stop& stop) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  while (!stop && std::chrono::steady_clock::now() < until) {
    if (inputs_->matchedReaders() > 0 && inbox_.matchedWriters() > 0) return {};
    std::this_thread::sleep_for(milliseconds(5));
  }
  return fail("the server of session '" + member_->sessionName() + "' does not listen to inputs");
}

}  // namespace tenon
