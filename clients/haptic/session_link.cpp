#include "clients/haptic/session_link.h"

#include <algorithm>
#include <cstdio>
#include <random>
#include <thread>
#include <utility>

namespace tenon {

namespace {
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;
constexpr milliseconds kAskAgain{500};
constexpr milliseconds kQuiet{300};  // after the last object of the scene

template <class M>
Result<void> openWriter(std::unique_ptr<Writer<M>>& writer, Partition& partition, const Topic<M>& topic) {
  auto opened = Writer<M>::open(partition, topic);
  if (!opened) return fail(opened.error().what);
  writer = std::make_unique<Writer<M>>(std::move(*opened));
  return {};
}

std::string randomName() {
  std::random_device source;
  char text[24];
  std::snprintf(text, sizeof text, "%08x%08x", source(), source());
  return text;
}

std::string named(const std::string& session) {
  return session.empty() ? "a session" : "session '" + session + "'";
}
}  // namespace

SessionLink::~SessionLink() {
  // says good-bye, so that nobody has to find out by waiting
  if (presence_writer_) static_cast<void>(presence_writer_->dispose(presence_));
}

Result<std::unique_ptr<SessionLink>> SessionLink::join(const LinkWishes& wishes,
                                                       const std::atomic<bool>& stop) {
  std::unique_ptr<SessionLink> link(new SessionLink());
  auto done = link->findSession(wishes, stop);
  if (done) done = link->ask(wishes, stop);
  if (done) done = link->openSession(wishes);
  if (!done) return fail(done.error().what);
  return link;
}

Result<void> SessionLink::findSession(const LinkWishes& wishes, const std::atomic<bool>& stop) {
  // streams of a session in lockstep are reliable; the lobby is the same for both
  for (const LinkProfile profile : {LinkProfile::kLan, LinkProfile::kLockstep}) {
    auto participant = Participant::open({.domain = wishes.domain, .profile = profile, .config = {}});
    if (!participant) return fail(participant.error().what);
    participant_ = std::move(*participant);
    lobby_ = std::make_unique<Partition>(participant_, kLobby, LinkProfile::kLan);
    if (profile == LinkProfile::kLockstep) break;
    auto reader = Reader<SessionAnnounce>::open(*lobby_, kSessionAnnounce);
    if (!reader) return fail(reader.error().what);
    const auto until = Clock::now() + wishes.patience;
    bool found = false;
    while (!found && !stop && Clock::now() < until) {
      while (!found && reader->take(announce_))
        found = wishes.session.empty() || announce_.session == wishes.session;
      if (!found) std::this_thread::sleep_for(milliseconds(20));
    }
    if (stop) return fail("stopped while looking for " + named(wishes.session));
    if (!found) {
      return fail("no server announced " + named(wishes.session) + " on domain " +
                  std::to_string(wishes.domain) + " within " + std::to_string(wishes.patience.count()) +
                  " s: start one with `tenon serve`");
    }
    if (announce_.protocol_version != kProtocolVersion) {
      return fail("the server speaks protocol " + std::to_string(announce_.protocol_version) +
                  ", this program " + std::to_string(kProtocolVersion) + ": update the older of the two");
    }
    if (!announce_.lockstep) break;
  }
  session_ = std::make_unique<Partition>(participant_, sessionPartition(announce_.session));
  return {};
}

Result<void> SessionLink::ask(const LinkWishes& wishes, const std::atomic<bool>& stop) {
  auto joins = Writer<Join>::open(*lobby_, kJoin);
  if (!joins) return fail(joins.error().what);
  auto welcomes = Reader<Welcome>::open(*lobby_, kWelcome);
  if (!welcomes) return fail(welcomes.error().what);
  Join join;
  join.client_guid = randomName();
  join.name = wishes.person;
  join.role = wishes.role;
  join.hands = wishes.hands;
  const auto until = Clock::now() + wishes.patience;
  auto next_question = Clock::now();
  while (!stop && Clock::now() < until) {
    if (Clock::now() >= next_question && joins->matchedReaders() > 0 && welcomes->matchedWriters() > 0) {
      static_cast<void>(joins->write(join));
      next_question = Clock::now() + kAskAgain;
    }
    while (welcomes->take(welcome_)) {
      if (welcome_.client_guid != join.client_guid) continue;
      if (!welcome_.accepted)
        return fail("the server of session '" + announce_.session + "' refuses: " + welcome_.reason);
      return {};
    }
    std::this_thread::sleep_for(milliseconds(5));
  }
  if (stop) return fail("stopped while joining session '" + announce_.session + "'");
  return fail("the server of session '" + announce_.session +
              "' does not answer: it may be hung or just gone");
}

Result<void> SessionLink::openSession(const LinkWishes& wishes) {
  Result<void> opened = openWriter(presence_writer_, *session_, kPresence);
  if (opened) opened = openWriter(inputs_, *session_, kDeviceInput);
  if (opened) opened = openWriter(states_, *session_, kHandState100);
  if (opened) opened = openWriter(events_, *session_, kClientEvent);
  if (opened) opened = openWriter(telemetry_, *session_, kTelemetry);
  if (!opened) return opened;
  presence_.client = welcome_.client;
  presence_.name = wishes.person;
  presence_.role = wishes.role;
  for (const HandId hand : welcome_.hands) {
    if (hand.valid()) presence_.hands.push_back(hand);
  }
  if (auto told = presence_writer_->write(presence_); !told) return told;

  auto reader = Reader<SceneObject>::open(*session_, kSceneObject);
  if (!reader) return fail(reader.error().what);
  const auto until = Clock::now() + wishes.patience;
  auto last = Clock::now();
  SceneObject object;
  while (Clock::now() < until && (objects_.empty() || Clock::now() - last < kQuiet)) {
    while (reader->take(object)) {
      objects_.push_back(object);
      last = Clock::now();
    }
    std::this_thread::sleep_for(milliseconds(5));
  }
  if (objects_.empty())
    return fail("the server of session '" + announce_.session + "' sent no objects of its scene");
  std::sort(objects_.begin(), objects_.end(),
            [](const SceneObject& a, const SceneObject& b) { return a.object < b.object; });
  return {};
}

Result<void> SessionLink::settle(const std::atomic<bool>& stop) {
  const auto until = Clock::now() + std::chrono::seconds(5);
  while (!stop && Clock::now() < until) {
    if (inputs_->matchedReaders() > 0 && inbox_.matchedWriters() > 0) return {};
    std::this_thread::sleep_for(milliseconds(5));
  }
  return fail("the server of session '" + announce_.session + "' does not listen to inputs");
}

}  // namespace tenon
