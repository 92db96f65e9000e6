#include "clients/observer/observer_program.h"

#include <cstdio>
#include <optional>
#include <random>
#include <thread>

#include "idl/wire/endpoint.h"

namespace tenon {

namespace {
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

std::string randomName() {
  std::random_device source;
  char text[24];
  std::snprintf(text, sizeof text, "%08x%08x", source(), source());
  return text;
}

/// The announcement of the session, or why there is none.
Result<SessionAnnounce> findSession(Partition& lobby, const ObserverProgramOptions& options,
                                    const std::atomic<bool>& stop) {
  auto reader = Reader<SessionAnnounce>::open(lobby, kSessionAnnounce);
  if (!reader) return fail(reader.error().what);
  const std::string wanted = options.session.empty() ? "a session" : "session '" + options.session + "'";
  SessionAnnounce announce;
  for (const auto until = Clock::now() + options.patience; !stop && Clock::now() < until;) {
    while (reader->take(announce)) {
      if (options.session.empty() || announce.session == options.session) return announce;
    }
    std::this_thread::sleep_for(milliseconds(20));
  }
  if (stop) return fail("stopped while looking for " + wanted);
  return fail("no server announced " + wanted + " on domain " + std::to_string(options.domain) + " within " +
              std::to_string(options.patience.count()) + " s: start one with `tenon serve`");
}

/// Asks for a seat until the server answers.
Result<Welcome> joinSession(Partition& lobby, const ObserverProgramOptions& options,
                            const std::atomic<bool>& stop) {
  auto joins = Writer<Join>::open(lobby, kJoin);
  if (!joins) return fail(joins.error().what);
  auto welcomes = Reader<Welcome>::open(lobby, kWelcome);
  if (!welcomes) return fail(welcomes.error().what);
  Join join;
  join.client_guid = randomName();
  join.name = options.person;
  join.role = Role::kObserver;
  Welcome welcome;
  auto ask_at = Clock::now();
  for (const auto until = Clock::now() + options.patience; !stop && Clock::now() < until;) {
    if (Clock::now() >= ask_at && joins->matchedReaders() > 0 && welcomes->matchedWriters() > 0) {
      static_cast<void>(joins->write(join));
      ask_at = Clock::now() + milliseconds(500);
    }
    while (welcomes->take(welcome)) {
      if (welcome.client_guid != join.client_guid) continue;
      if (!welcome.accepted) return fail("the server refuses: " + welcome.reason);
      return welcome;
    }
    std::this_thread::sleep_for(milliseconds(5));
  }
  return fail("the server does not answer: it may be hung or just gone");
}
}  // namespace

Result<void> observe(Observer& observer, const ObserverProgramOptions& options,
                     const std::atomic<bool>& stop) {
  auto participant =
      Participant::open({.domain = options.domain, .profile = LinkProfile::kLan, .config = {}});
  if (!participant) return fail(participant.error().what);
  Partition lobby(*participant, kLobby, LinkProfile::kLan);
  const auto announce = findSession(lobby, options, stop);
  if (!announce) return fail(announce.error().what);
  const auto welcome = joinSession(lobby, options, stop);
  if (!welcome) return fail(welcome.error().what);

  // who only looks reads streams as they come, whatever the session's own pace
  Partition session(*participant, sessionPartition(announce->session), LinkProfile::kLan);
  auto presence_writer = Writer<Presence>::open(session, kPresence);
  if (!presence_writer) return fail(presence_writer.error().what);
  const Presence presence{welcome->client, options.person, Role::kObserver, {}, true};
  if (auto told = presence_writer->write(presence); !told) return told;

  Inbox inbox;
  bool server_gone = false;
  Result<void> all;
  const auto listen = [&]<class M>(const Topic<M>& topic) {
    if (all) all = inbox.on<M>(session, topic, [&observer](const M& message) { observer.hear(message); });
  };
  listen(kSceneObject);
  listen(kPresence);
  listen(kStepState);
  listen(kStepProgress);
  listen(kContactPairs100);
  listen(kEventLog);
  listen(kEmergencyStop);
  listen(kRunState);
  if (all) {
    all = inbox.onGone<SessionAnnounce>(lobby, kSessionAnnounce, [&](const SessionAnnounce& gone) {
      if (gone.session == announce->session) server_gone = true;
    });
  }
  if (!all) return all;
  while (!stop && !observer.over() && !server_gone) inbox.dispatch(milliseconds(100));
  static_cast<void>(presence_writer->dispose(presence));
  if (server_gone && !observer.over())
    return fail("the server of session '" + announce->session + "' is gone");
  return {};
}

}  // namespace tenon
