#include "idl/wire/membership.h"

#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/types/messages/commands.h"
#include "idl/types/messages/journal.h"
#include "idl/types/messages/log.h"
#include "idl/types/messages/run.h"
#include "idl/wire/codec.h"
#include "idl/wire/raw_subscriber.h"
#include "tests/idl/wire/peer.h"

namespace tenon::wire {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A server in a process of its own with one seat. It refuses a client that wants hand "taken", asks Bob for
/// a proof, and removes the client when it receives a ClientEvent: the presence of its first request if the
/// event is "late", else the newest one; as displaced if the event is "displaced".
void runServer(std::uint32_t domain, const std::string& scenario_hash = "") {
  auto participant = test::participant(domain);
  Partition lobby(participant, kLobby);
  Partition session(participant, sessionPartition("test"));
  auto announces = Writer<SessionAnnounce>::open(lobby, kSessionAnnounce);
  auto welcomes = Writer<Welcome>::open(lobby, kWelcome);
  if (!announces || !announces->write({.session = "test", .server_epoch = 7, .scenario_hash = scenario_hash}))
    _exit(1);
  Inbox inbox;
  std::uint32_t asked = 0;
  std::string guid, first_guid;
  auto heard = inbox.on<Join>(lobby, kJoin, [&](const Join& join) {
    guid = join.client_guid;
    if (first_guid.empty()) first_guid = guid;
    Welcome answer{.client_guid = guid, .session = join.session, .server_epoch = 7};
    if (!join.hands.empty() && join.hands.front() == "taken") {
      answer.reason = "that hand is taken";
    } else if (join.name == "Bob" && join.seat_proof.empty()) {
      answer.challenge = "prove it";
    } else {
      answer.accepted = true;
      answer.client = ClientId{1};
      answer.tick = ++asked;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));  // some periods of who asks
    if (!welcomes->write(answer)) _exit(1);
  });
  if (heard) {
    heard = inbox.on<ClientEvent>(session, kClientEvent, [&](const ClientEvent& event) {
      const bool is_late = event.kind == "late";
      (void)welcomes->write({.client_guid = is_late ? first_guid : guid,
                             .session = "test",
                             .server_epoch = 7,
                             .reason = is_late                     ? "late"
                                       : event.kind == "displaced" ? kSeatTaken
                                                                   : "too loud",
                             .client = ClientId{1}});
    });
  }
  if (!heard) _exit(1);
  while (true) inbox.dispatch(std::chrono::seconds(1));
}

MembershipOptions traineeOptions(std::uint32_t domain) {
  return {.domain = domain, .person = "Ada", .role = Role::kTrainee, .timeout = std::chrono::seconds(60)};
}

/// A client that has a seat and hears its server.
struct Seated {
  std::uint32_t domain = test::ownDomain();
  test::Peer peer{[this] { runServer(domain); }};
  std::atomic<bool> stop = false;
  std::unique_ptr<Membership> member;
  Inbox inbox;
  std::optional<Writer<ClientEvent>> events;  ///< by which the server removes it

  void take(const std::string& person = "Ada") {
    MembershipOptions options = traineeOptions(domain);
    options.person = person;
    auto found = Membership::find(options, stop);
    ASSERT_TRUE(found) << found.error().what;
    member = std::move(*found);
    ASSERT_TRUE(member->join(stop));
    ASSERT_TRUE(member->watch(inbox));
    auto opened = Writer<ClientEvent>::open(member->session(), kClientEvent);
    ASSERT_TRUE(opened);
    events.emplace(std::move(*opened));
    ASSERT_TRUE(test::dispatchUntil(
        inbox, [&] { return events->matchedReaders() == 1 && inbox.matchedWriters() >= 2; }));
  }
};

//   this process: find, join        lobby        peer: announce, welcome
TEST(Membership, FindsTheSessionOfAnotherProcessAndJoins) {
  const std::uint32_t domain = test::ownDomain();
  const test::Peer peer([domain] { runServer(domain); });
  const std::atomic<bool> stop = false;
  auto member = Membership::find(traineeOptions(domain), stop);
  ASSERT_TRUE(member) << member.error().what;
  EXPECT_EQ((*member)->sessionName(), "test");
  int calls = 0;
  const auto joined = (*member)->join(stop, [&] { ++calls; });
  ASSERT_TRUE(joined) << joined.error().what;
  EXPECT_GT(calls, 0) << "a recorder takes samples meanwhile";
  EXPECT_EQ((*member)->welcome().client, ClientId{1});
  EXPECT_EQ((*member)->welcome().server_epoch, 7U);
  EXPECT_FALSE((*member)->lost());
}

TEST(Membership, ARefusalHasTheServersReason) {
  const std::uint32_t domain = test::ownDomain();
  const test::Peer peer([domain] { runServer(domain); });
  const std::atomic<bool> stop = false;
  MembershipOptions options = traineeOptions(domain);
  options.hands = {"taken"};
  auto member = Membership::find(options, stop);
  ASSERT_TRUE(member) << member.error().what;
  const auto joined = (*member)->join(stop);
  ASSERT_FALSE(joined);
  EXPECT_THAT(joined.error().what, HasSubstr("refuses: that hand is taken"));
}

TEST(Membership, ARemovedClientRejoins) {
  Seated seated;
  ASSERT_NO_FATAL_FAILURE(seated.take());
  const auto& member = seated.member;
  Inbox& inbox = seated.inbox;
  ASSERT_TRUE(seated.events->write({.client = ClientId{1}, .seq = 1, .kind = "hello", .text = "HELLO"}));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return member->lost().has_value(); }));
  EXPECT_THAT(*member->lost(), HasSubstr("too loud"));
  EXPECT_FALSE(member->serverIsGone());

  const auto back = member->rejoin(seated.stop, [&] { inbox.dispatch(milliseconds(0)); });
  ASSERT_TRUE(back) << back.error().what;
  EXPECT_EQ(member->welcome().tick, 2U) << "the answer to the second request";
  inbox.dispatch(milliseconds(50));
  EXPECT_FALSE(member->lost());

  // what is said of the presence that it removed does not end the new one
  bool heard = false;
  ASSERT_TRUE(inbox.on<Welcome>(member->lobby(), kWelcome,
                                [&](const Welcome& notice) { heard = heard || notice.reason == "late"; }));
  ASSERT_TRUE(seated.events->write({.client = ClientId{1}, .seq = 2, .kind = "late", .text = "too loud"}));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return heard; }));
  inbox.dispatch(milliseconds(50));
  EXPECT_FALSE(member->lost());
}

TEST(Membership, AProgramWhoseSeatIsTakenDoesNotTakeItBack) {
  Seated seated;
  ASSERT_NO_FATAL_FAILURE(seated.take());
  const auto& member = seated.member;
  Inbox& inbox = seated.inbox;
  ASSERT_TRUE(
      seated.events->write({.client = ClientId{1}, .seq = 1, .kind = "displaced", .text = "displaced"}));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return member->lost().has_value(); }));
  EXPECT_TRUE(member->isDisplaced());
  const auto back = member->rejoin(seated.stop);
  ASSERT_FALSE(back);
  EXPECT_THAT(*member->lost() + "; " + back.error().what, HasSubstr("another program has taken this seat"));
}

TEST(Membership, AChallengeOfARejoinEndsNoPresence) {
  Seated seated;
  ASSERT_NO_FATAL_FAILURE(seated.take("Bob"));
  const auto& member = seated.member;
  Inbox& inbox = seated.inbox;
  Inbox others;
  bool is_seen = false, has_left = false;
  const auto bus = test::participant(seated.domain);
  Partition session(bus, sessionPartition("test"));
  ASSERT_TRUE(others.on<Presence>(session, kPresence, [&](const Presence&) { is_seen = true; }));
  ASSERT_TRUE(others.onGone<Presence>(session, kPresence, [&](const Presence&) { has_left = true; }));
  ASSERT_TRUE(test::dispatchUntil(others, [&] { return is_seen; }));
  ASSERT_TRUE(member->rejoin(seated.stop, [&] {
    inbox.dispatch(milliseconds(0));
    EXPECT_FALSE(member->lost());
  }));
  for (int i = 0; i < 10; ++i) others.dispatch(milliseconds(20));
  EXPECT_FALSE(has_left);
}

TEST(Membership, AKilledServerIsReportedAsGoneAndAMissingOneAsNotAnnounced) {
  const std::uint32_t domain = test::ownDomain();
  test::Peer peer([domain] { runServer(domain); });
  const std::atomic<bool> stop = false;
  auto member = Membership::find(traineeOptions(domain), stop);
  ASSERT_TRUE(member) << member.error().what;
  ASSERT_TRUE((*member)->join(stop));
  Inbox inbox;
  ASSERT_TRUE((*member)->watch(inbox));
  bool announced = false;
  ASSERT_TRUE(inbox.on<SessionAnnounce>((*member)->lobby(), kSessionAnnounce,
                                        [&](const SessionAnnounce&) { announced = true; }));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return announced; }));
  peer.kill();
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return (*member)->serverIsGone(); }));
  EXPECT_THAT(*(*member)->lost(), HasSubstr("'test' is gone"));

  MembershipOptions missing = traineeOptions(domain);
  missing.session = "nowhere";
  missing.timeout = std::chrono::seconds(0);
  const auto found = Membership::find(missing, stop);
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().what, HasSubstr("no server announced session 'nowhere'"));
  EXPECT_THAT(found.error().what, HasSubstr("on the network 'loopback'"));
  EXPECT_THAT(found.error().what, HasSubstr("tenon serve"));
}

TEST(Membership, AServerThatEndsBeforeItIsWatchedIsGoneToo) {
  const std::uint32_t domain = test::ownDomain();
  test::Peer peer([domain] { runServer(domain); });
  const std::atomic<bool> stop = false;
  auto member = Membership::find(traineeOptions(domain), stop);
  ASSERT_TRUE(member) << member.error().what;
  ASSERT_TRUE((*member)->join(stop));
  Inbox witness;
  bool gone = false, announced = false;
  ASSERT_TRUE(witness.on<SessionAnnounce>((*member)->lobby(), kSessionAnnounce,
                                          [&](const SessionAnnounce&) { announced = true; }));
  ASSERT_TRUE(witness.onGone<SessionAnnounce>((*member)->lobby(), kSessionAnnounce,
                                              [&](const SessionAnnounce&) { gone = true; }));
  ASSERT_TRUE(test::dispatchUntil(witness, [&] { return announced; }));
  peer.kill();
  ASSERT_TRUE(test::dispatchUntil(witness, [&] { return gone; }));
  Inbox inbox;
  ASSERT_TRUE((*member)->watch(inbox));
  EXPECT_FALSE((*member)->lost()) << "it may be about to be heard";
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return (*member)->lost().has_value(); }));
  EXPECT_THAT(*(*member)->lost(), HasSubstr("'test' is gone"));
  EXPECT_TRUE((*member)->serverIsGone());
}

TEST(Membership, DoesNotRejoinASessionOfAnotherScenario) {
  const std::uint32_t domain = test::ownDomain();
  test::Peer peer([domain] { runServer(domain, "one"); });
  const std::atomic<bool> stop = false;
  auto member = Membership::find(traineeOptions(domain), stop);
  ASSERT_TRUE(member) << member.error().what;
  ASSERT_TRUE((*member)->join(stop));
  Inbox inbox;
  ASSERT_TRUE((*member)->watch(inbox));
  bool announced = false;
  ASSERT_TRUE(inbox.on<SessionAnnounce>((*member)->lobby(), kSessionAnnounce,
                                        [&](const SessionAnnounce&) { announced = true; }));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return announced; }));
  peer.kill();
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return (*member)->serverIsGone(); }));
  auto next = test::participant(domain);
  Partition lobby(next, kLobby);
  auto announces = Writer<SessionAnnounce>::open(lobby, kSessionAnnounce);
  ASSERT_TRUE(announces);
  ASSERT_TRUE(announces->write({.session = "test", .server_epoch = 8, .scenario_hash = "other"}));
  const auto back = (*member)->rejoin(stop);
  ASSERT_FALSE(back);
  EXPECT_THAT(back.error().what, HasSubstr("runs another scenario now"));
}

// The server of a name, and another one that calls itself the same and started later.
TEST(Membership, BelongsToTheServerOfItsNameThatStartedFirst) {
  const std::uint32_t domain = test::ownDomain();
  auto foreign = test::participant(domain);
  Partition foreign_lobby(foreign, kLobby);
  Partition foreign_session(foreign, sessionPartition("test"));
  auto foreign_announces = Writer<SessionAnnounce>::open(foreign_lobby, kSessionAnnounce);
  auto foreign_runs = Writer<RunState>::open(foreign_session, kRunState);
  ASSERT_TRUE(foreign_announces->write({.session = "test", .server_epoch = 9}));

  auto genuine = test::participant(domain);
  Partition lobby(genuine, kLobby);
  Partition session(genuine, sessionPartition("test"));
  auto announces = Writer<SessionAnnounce>::open(lobby, kSessionAnnounce);
  auto runs = Writer<RunState>::open(session, kRunState);
  ASSERT_TRUE(announces->write({.session = "test", .server_epoch = 8}));

  const std::atomic<bool> stop = false;
  auto member = Membership::find(traineeOptions(domain), stop);
  ASSERT_TRUE(member) << member.error().what;
  EXPECT_EQ((*member)->announce().server_epoch, 8U);
  EXPECT_TRUE((*member)->isServer(genuine->origin()));
  EXPECT_FALSE((*member)->isServer(foreign->origin()));

  Inbox inbox;
  std::vector<std::string> reasons;
  ASSERT_TRUE((*member)->watch(inbox));
  ASSERT_TRUE(inbox.on<RunState>((*member)->session(), kRunState,
                                 [&](const RunState& run) { reasons.push_back(run.reason); }));
  ASSERT_TRUE(test::dispatchUntil(
      inbox, [&] { return foreign_runs->matchedReaders() == 1 && runs->matchedReaders() == 1; }));
  // the foreign state comes after the genuine one and before anything is taken
  ASSERT_TRUE(runs->write({.phase = RunPhase::kRunning, .reason = "genuine"}));
  ASSERT_TRUE(foreign_runs->write({.phase = RunPhase::kStopped, .reason = "foreign"}));
  std::this_thread::sleep_for(milliseconds(100));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return !reasons.empty(); }));
  EXPECT_THAT(reasons, ::testing::ElementsAre("genuine"));
  // the foreign server ends: that is not the end of this one's
  ASSERT_TRUE(foreign_announces->dispose({.session = "test", .server_epoch = 9}));
  for (int i = 0; i < 10; ++i) inbox.dispatch(milliseconds(20));
  EXPECT_FALSE((*member)->serverIsGone());
  ASSERT_TRUE(announces->dispose({.session = "test", .server_epoch = 8}));
  EXPECT_TRUE(test::dispatchUntil(inbox, [&] { return (*member)->serverIsGone(); }));
}

// What a new server publishes once reaches a client that notices only later that its own is gone.
TEST(Membership, TheStatesOfTheNextServerAreThereWhenAClientBelongsToIt) {
  const std::uint32_t domain = test::ownDomain();
  auto first = test::participant(domain);
  auto second = test::participant(domain);
  auto client = test::participant(domain);
  Partition first_session(first, "s/test"), second_session(second, "s/test"), session(client, "s/test");
  auto first_runs = Writer<RunState>::open(first_session, kRunState);
  auto second_runs = Writer<RunState>::open(second_session, kRunState);
  session.hearOnly(first->origin());
  Inbox inbox;
  std::vector<std::string> reasons;
  ASSERT_TRUE(
      inbox.on<RunState>(session, kRunState, [&](const RunState& run) { reasons.push_back(run.reason); }));
  ASSERT_TRUE(test::dispatchUntil(
      inbox, [&] { return first_runs->matchedReaders() == 1 && second_runs->matchedReaders() == 1; }));
  ASSERT_TRUE(second_runs->write({.reason = "second"}));
  ASSERT_TRUE(first_runs->write({.reason = "first"}));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return !reasons.empty(); }));
  for (int i = 0; i < 5; ++i) inbox.dispatch(milliseconds(20));
  EXPECT_THAT(reasons, ::testing::ElementsAre("first"));
  session.hearOnly(second->origin());
  inbox.dispatch(milliseconds(0));
  EXPECT_THAT(reasons, ::testing::ElementsAre("first", "second"));
  inbox.dispatch(milliseconds(0));
  EXPECT_EQ(reasons.size(), 2U) << "once";
}

// A recorder gets what the next server published of its journal before the recorder knew of it.
TEST(Membership, WhatTheNextServerKeepsForLateJoinersIsThereWhenARecorderBelongsToIt) {
  const std::uint32_t domain = test::ownDomain();
  auto first = test::participant(domain);
  auto second = test::participant(domain);
  auto client = test::participant(domain);
  Partition first_session(first, "s/test"), second_session(second, "s/test"), session(client, "s/test");
  auto first_inputs = Writer<TickInputPart>::open(first_session, kTickInput);
  auto second_inputs = Writer<TickInputPart>::open(second_session, kTickInput);
  session.hearOnly(first->origin());
  auto subscriber = RawSubscriber::open(session, {std::string(kTickInput.name)});
  std::vector<Tick> ticks;
  const auto dispatch = [&] {
    subscriber->dispatch(milliseconds(20), [&](const RawSample& sample) {
      ticks.push_back(decode<TickInputPart>(sample.bytes)->tick);
    });
  };
  for (Tick tick = 1; tick <= 3; ++tick) ASSERT_TRUE(second_inputs->write({.tick = 10 + tick}));
  ASSERT_TRUE(first_inputs->write({.tick = 5}));
  for (int i = 0; i < 500 && ticks.empty(); ++i) dispatch();
  for (int i = 0; i < 10; ++i) dispatch();
  EXPECT_THAT(ticks, ::testing::ElementsAre(5));
  session.hearOnly(second->origin());
  dispatch();
  ASSERT_TRUE(second_inputs->write({.tick = 14}));
  for (int i = 0; i < 500 && ticks.size() < 5; ++i) dispatch();
  EXPECT_THAT(ticks, ::testing::ElementsAre(5, 11, 12, 13, 14));
}

// Whatever somebody else writes meanwhile.
TEST(Membership, OneThatWritesWithoutEndPushesNothingOfTheNextServerOut) {
  constexpr std::uint64_t kMost = 2000;  // of a writer, for a topic that late joiners get 1000 of
  const std::uint32_t domain = test::ownDomain();
  auto next = test::participant(domain);
  auto stranger = test::participant(domain);
  auto client = test::participant(domain);
  Partition next_session(next, "s/test"), strange_session(stranger, "s/test"), session(client, "s/test");
  auto events = Writer<EventLog>::open(next_session, kEventLog);
  auto flood = Writer<EventLog>::open(strange_session, kEventLog);
  session.hearOnly(client->origin());  // nobody who writes
  auto subscriber = RawSubscriber::open(session, {std::string(kEventLog.name)});
  std::vector<std::uint64_t> heard;
  const auto dispatch = [&] {
    subscriber->dispatch(milliseconds(5), [&](const RawSample& sample) {
      heard.push_back(decode<EventLog>(sample.bytes)->seq);
    });
  };
  const auto writeAll = [&](Writer<EventLog>& writer, std::uint64_t first, std::uint64_t count) {
    for (std::uint64_t seq = first; seq < first + count; ++seq) {
      ASSERT_TRUE(writer.write({.seq = seq}));
      if (seq % 100 == 0) dispatch();
    }
  };
  for (int i = 0; i < 500 && (events->matchedReaders() == 0 || flood->matchedReaders() == 0); ++i) dispatch();
  writeAll(*events, 1, 10);
  writeAll(*flood, 1'000'000, 2 * kMost);
  for (int i = 0; i < 20; ++i) dispatch();
  EXPECT_TRUE(heard.empty());
  session.hearOnly(next->origin());
  dispatch();
  EXPECT_THAT(heard, ::testing::ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9, 10));
  EXPECT_EQ(subscriber->lost(), 0U);

  // of its own too many
  heard.clear();
  session.hearOnly(client->origin());
  dispatch();
  writeAll(*events, 11, kMost + 7);
  for (int i = 0; i < 20; ++i) dispatch();
  session.hearOnly(next->origin());
  dispatch();
  EXPECT_EQ(heard.size(), kMost);
  EXPECT_EQ(subscriber->lost(), 7U);
}

TEST(Membership, WhatANextServerWritesBehindTooManyOthersIsCountedAsLost) {
  constexpr std::size_t kMostWriters = 16;  // whose samples are kept
  const std::uint32_t domain = test::ownDomain();
  auto next = test::participant(domain);
  auto stranger = test::participant(domain);
  auto client = test::participant(domain);
  Partition next_session(next, "s/test"), strange_session(stranger, "s/test"), session(client, "s/test");
  session.hearOnly(client->origin());  // nobody who writes
  auto subscriber = RawSubscriber::open(session, {std::string(kEventLog.name)});
  std::size_t heard = 0;
  const auto write = [&](Writer<EventLog>& writer, int count) {
    for (int i = 0; i < 500 && writer.matchedReaders() == 0; ++i)
      subscriber->dispatch(milliseconds(5), [](const RawSample&) {});
    for (int i = 0; i < count; ++i) ASSERT_TRUE(writer.write({.seq = 1}));
    ASSERT_TRUE(writer.waitForReaders(std::chrono::seconds(10)));
    subscriber->dispatch(milliseconds(5), [&](const RawSample&) { ++heard; });
  };
  std::vector<Writer<EventLog>> others;
  for (std::size_t i = 0; i < kMostWriters; ++i) {
    others.push_back(std::move(*Writer<EventLog>::open(strange_session, kEventLog)));
    write(others.back(), 1);
  }
  auto events = Writer<EventLog>::open(next_session, kEventLog);
  write(*events, 3);
  session.hearOnly(next->origin());
  subscriber->dispatch(milliseconds(5), [&](const RawSample&) { ++heard; });
  EXPECT_EQ(heard, 0U);
  EXPECT_EQ(subscriber->lost(), 3U);
}

// two participants write equal samples to one topic: their origins differ
TEST(Origin, IsThatOfTheWritingParticipant) {
  const std::uint32_t domain = test::ownDomain();
  auto server = test::participant(domain);
  auto client = test::participant(domain);
  auto intruder = test::participant(domain);
  Partition session(server, "s/test");
  Partition client_session(client, "s/test");
  Partition intruder_session(intruder, "s/test");
  auto client_writer = Writer<Command>::open(client_session, kCommand);
  auto intruder_writer = Writer<Command>::open(intruder_session, kCommand);
  Inbox inbox;
  std::vector<Origin> origins;
  ASSERT_TRUE(inbox.onFrom<Command>(session, kCommand,
                                    [&](const Command&, const Origin& from) { origins.push_back(from); }));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return inbox.matchedWriters() == 2; }));
  const Command same{.client = ClientId{1}, .id = 1};
  ASSERT_TRUE(client_writer->write(same));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return origins.size() == 1; }));
  ASSERT_TRUE(intruder_writer->write(same));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] { return origins.size() == 2; }));
  EXPECT_EQ(origins[0], client->origin());
  EXPECT_EQ(origins[1], intruder->origin());
  EXPECT_NE(origins[0], origins[1]);
  EXPECT_TRUE(origins[0].known());
}

}  // namespace
}  // namespace tenon::wire
