#include "clients/console/desk.h"

#include <mutex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/types/messages/commands.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/session.h"
#include "idl/types/stop_truth.h"
#include "idl/wire/endpoint.h"
#include "tests/clients/fake_session.h"
#include "tests/idl/wire/peer.h"

namespace tenon::console {
namespace {

constexpr ViewerId kAda = 1, kBob = 2;

DeskRequest emergency(std::uint32_t id, std::string reason = "pressed") {
  return {.id = id, .words = {"emergency", std::move(reason)}};
}

/// What a session hears of raises, and a server that announces it and repeats them when it is asked to.
class SessionMock {
 public:
  explicit SessionMock(const std::string& name)
      : bus_(test::participant(test::ownDomain())), session_(bus_, wire::sessionPartition(name)) {
    EXPECT_TRUE(announce_.write({.session = name}));
    EXPECT_TRUE(inbox_.onFrom<EmergencyStop>(session_, wire::kEmergencyStop,
                                             [this](const EmergencyStop& stop, const wire::Origin&) {
                                               if (truth_.raise(stop)) raises_.push_back(stop);
                                             }));
  }
  /// Until so many raises were heard.
  bool hears(std::size_t raises) {
    return test::dispatchUntil(inbox_, [&] { return raises_.size() >= raises; });
  }

  std::shared_ptr<wire::Participant> bus_;
  wire::Partition lobby_{bus_, wire::kLobby};
  wire::Partition session_;
  wire::Writer<SessionAnnounce> announce_ =
      std::move(*wire::Writer<SessionAnnounce>::open(lobby_, wire::kSessionAnnounce));
  wire::Writer<EmergencyStop> repeats_ =
      std::move(*wire::Writer<EmergencyStop>::open(session_, wire::kEmergencyStop));
  wire::Inbox inbox_;
  StopTruth truth_;
  std::vector<EmergencyStop> raises_;
};

class DeskTest : public ::testing::Test {
 protected:
  struct Told {
    ViewerId viewer = 0;
    DeskAnswer answer;
  };
  /// Until so many answers were given.
  std::vector<Told> answers(std::size_t count) {
    wire::Inbox nothing;
    EXPECT_TRUE(test::dispatchUntil(nothing, [&] { return told().size() >= count; }));
    return told();
  }
  std::vector<Told> told() {
    const std::scoped_lock lock(mutex_);
    return told_;
  }

  std::mutex mutex_;
  std::vector<Told> told_;
  std::unique_ptr<Desk> desk_ =
      std::make_unique<Desk>(SeatRights{.domain = test::ownDomain(), .pass = "secret"}, "", "",
                             [this](ViewerId viewer, const DeskAnswer& answer) {
                               const std::scoped_lock lock(mutex_);
                               told_.push_back({viewer, answer});
                             });
};

// pressed, cleared by an instructor, pressed again before the first press is answered
TEST_F(DeskTest, AStopAfterAClearIsRaisedAnewAndAnsweredAsItStands) {
  SessionMock session("a");
  desk_->handle(kAda, "a", emergency(1));
  ASSERT_TRUE(session.hears(1));
  const EmergencyStop& first = session.raises_[0];
  session.truth_.clear({.client_guid = first.client_guid, .counter = first.counter});
  ASSERT_FALSE(session.truth_.engaged());
  desk_->handle(kBob, "a", emergency(7));
  ASSERT_TRUE(session.hears(2)) << "the second press was not raised";
  EXPECT_TRUE(session.truth_.engaged());
  for (const EmergencyStop& raise : session.raises_) ASSERT_TRUE(session.repeats_.write(raise));
  const auto told = answers(2);
  EXPECT_THAT((std::vector{told[0].answer.id, told[1].answer.id}), testing::UnorderedElementsAre(1U, 7U));
  EXPECT_TRUE(told[0].answer.accepted && told[1].answer.accepted);
}

TEST_F(DeskTest, AStopWaitsForNoOtherSession) {
  SessionMock a("a"), b("b");
  // both are ready
  desk_->handle(kAda, "a", emergency(1));
  desk_->handle(kBob, "b", emergency(1));
  answers(2);
  ASSERT_TRUE(a.hears(1) && b.hears(1));

  // nobody answers a's
  desk_->handle(kAda, "a", emergency(2));
  ASSERT_TRUE(a.hears(2));
  desk_->handle(kBob, "b", emergency(2));
  ASSERT_TRUE(b.hears(2));
  EXPECT_EQ(told().size(), 2U) << "b's was raised only after the answer to a's";
}

TEST_F(DeskTest, EachPressIsAnsweredOnceHoweverMany) {
  SessionMock session("a");
  constexpr std::uint32_t kPresses = 40;
  for (std::uint32_t id = 1; id <= kPresses; ++id) desk_->handle(kAda, "a", emergency(id));
  const auto told = answers(kPresses);
  std::set<std::uint32_t> ids;
  std::size_t refused = 0;
  for (const Told& one : told) {
    ids.insert(one.answer.id);
    refused += one.answer.text.starts_with("too many emergency stops") ? 1 : 0;
  }
  EXPECT_EQ(told.size(), kPresses);
  EXPECT_EQ(ids.size(), kPresses);
  EXPECT_EQ(refused, kPresses - Stopper::kMaxWaiting);
}

TEST_F(DeskTest, AStopThatWaitsWhenTheGatewayEndsIsRaised) {
  SessionMock session("a");
  desk_->handle(kAda, "a", emergency(1));
  ASSERT_TRUE(session.hears(1));
  desk_->handle(kAda, "a", emergency(2));  // within Stopper::kBetween, on most machines
  desk_.reset();
  EXPECT_TRUE(session.hears(2));
  EXPECT_EQ(told_.size(), 2U);
}

TEST_F(DeskTest, AReasonIsCutBetweenCharactersAndHasNoControlCharacters) {
  SessionMock session("a");
  std::string reason = "\n";
  for (int i = 0; i < 200; ++i) reason += "\xC3\xA4";
  desk_->handle(kAda, "a", emergency(1, reason));
  ASSERT_TRUE(session.hears(1));
  EXPECT_EQ(session.raises_[0].reason.size(), 255U);
  EXPECT_EQ(session.raises_[0].reason.front(), ' ');
  EXPECT_EQ(session.raises_[0].reason.substr(253), "\xC3\xA4");
}

TEST_F(DeskTest, WhatIsPreparedForASessionEndsWhenItIsNoMore) {
  SessionMock session("a");
  const std::size_t own = session.inbox_.matchedWriters();
  desk_->expect({"a"});
  ASSERT_TRUE(test::dispatchUntil(session.inbox_, [&] { return session.inbox_.matchedWriters() > own; }));
  desk_->expect({});
  EXPECT_TRUE(test::dispatchUntil(session.inbox_, [&] { return session.inbox_.matchedWriters() == own; }));
}

// the page says that it is confirmed when it is accepted
TEST_F(DeskTest, AStopThatNoServerHasPublishedIsNotAccepted) {
  SessionMock session("a");
  desk_->handle(kAda, "a", emergency(1));
  ASSERT_TRUE(session.hears(1));
  const DeskAnswer unheard = answers(1)[0].answer;
  EXPECT_FALSE(unheard.accepted);
  EXPECT_EQ(unheard.code, "stop_unheard") << "it was sent to a program, of which nothing is known";

  auto bus = test::participant(test::ownDomain());
  wire::Partition of_station(bus, wire::sessionPartition("a"));
  auto station = wire::Writer<EmergencyStop>::open(of_station, wire::kEmergencyStop);
  ASSERT_TRUE(station);
  desk_->handle(kAda, "a", emergency(2));
  ASSERT_TRUE(session.hears(2));
  ASSERT_TRUE(station->write(session.raises_[1]));
  const DeskAnswer reached = answers(2)[1].answer;
  EXPECT_FALSE(reached.accepted);
  EXPECT_EQ(reached.code, "stop_devices");
  EXPECT_THAT(reached.text, testing::HasSubstr("1 station has stopped; no server has answered"));
}

// as late as it begins to answer, it knows of the stop
TEST_F(DeskTest, ARaiseThatNoServerHasHeardStaysForOne) {
  SessionMock session("a");
  const std::size_t own = session.inbox_.matchedWriters();
  desk_->handle(kAda, "a", emergency(1));
  ASSERT_TRUE(session.hears(1));
  answers(1);
  desk_->expect({});
  desk_->expect({});
  EXPECT_GT(session.inbox_.matchedWriters(), own);
  ASSERT_TRUE(session.repeats_.write(session.raises_[0]));
  EXPECT_TRUE(test::dispatchUntil(session.inbox_, [&] {
    desk_->expect({});
    return session.inbox_.matchedWriters() == own;
  }));
}

// no server admits the seat, so that the commands wait
TEST_F(DeskTest, CommandsThatWaitAreRefusedWhenTheSeatIsLeft) {
  desk_->handle(kAda, "a", {.kind = DeskRequest::Kind::kSit, .id = 1, .role = "trainee", .name = "Ada"});
  for (std::uint32_t id = 2; id <= 4; ++id) desk_->handle(kAda, "a", {.id = id, .words = {"pause"}});
  desk_->handle(kAda, "a", {.kind = DeskRequest::Kind::kLeave, .id = 5});
  std::vector<std::uint32_t> ids;
  for (const Told& one : answers(5)) {
    ids.push_back(one.answer.id);
    EXPECT_EQ(one.answer.accepted, one.answer.id == 5) << one.answer.id;
    EXPECT_FALSE(one.answer.text.empty() && one.answer.id != 5);
  }
  EXPECT_THAT(ids, testing::UnorderedElementsAre(1U, 2U, 3U, 4U, 5U));
}

TEST_F(DeskTest, CommandsThatWaitAreNotSentAfterAStop) {
  SessionMock session("a");
  desk_->handle(kAda, "a", {.kind = DeskRequest::Kind::kSit, .id = 1, .role = "trainee", .name = "Ada"});
  desk_->handle(kBob, "b", {.kind = DeskRequest::Kind::kSit, .id = 1, .role = "trainee", .name = "Bob"});
  desk_->handle(kAda, "a", {.id = 2, .words = {"clear"}});
  desk_->handle(kBob, "b", {.id = 2, .words = {"pause"}});
  desk_->handle(kBob, "a", emergency(3));
  ASSERT_TRUE(session.hears(1));
  const auto first = answers(1)[0];
  EXPECT_EQ(first.viewer, kAda);
  EXPECT_EQ(first.answer.id, 2U);
  EXPECT_EQ(first.answer.text, "not sent: the emergency stop came after it");
  EXPECT_EQ(first.answer.code, "stopped");
  for (const Told& one : told())
    EXPECT_FALSE(one.viewer == kBob && one.answer.id == 2) << "of another session";
}

// each seat has a DDS participant of its own, until its thread has ended
TEST_F(DeskTest, SeatsThatAreBeingLeftCount) {
  constexpr ViewerId kAttempts = 100;
  for (ViewerId viewer = 1; viewer <= kAttempts; ++viewer) {
    desk_->handle(viewer, "a", {.kind = DeskRequest::Kind::kSit, .id = 1, .role = "trainee", .name = "x"});
    desk_->left(viewer);
  }
  const auto told = answers(kAttempts);
  EXPECT_THAT(told, testing::Contains(testing::Field(
                        &Told::answer, testing::Field(&DeskAnswer::text, testing::HasSubstr("all seats")))));
}

// the server forgot it while the gateway hung, and its notice of that was lost
TEST_F(DeskTest, ASeatOfWhichTheServerKnowsNothingHasEnded) {
  test::FakeSession session(test::ownDomain(), {});
  auto acks = wire::Writer<CommandAck>::open(session.session(), wire::kCommandAck);
  wire::Inbox commands;
  ASSERT_TRUE(commands.on<Command>(session.session(), wire::kCommand, [&](const Command& command) {
    (void)acks->write({command.client, command.id, false, "join first", Refusal::kNotJoined});
  }));
  const auto tellsUntil = [&](std::size_t count) {
    return session.serveUntil([&] {
      commands.dispatch(std::chrono::milliseconds(1));
      return told().size() >= count;
    });
  };
  desk_->handle(kAda, "test", {.kind = DeskRequest::Kind::kSit, .id = 1, .role = "trainee", .name = "Ada"});
  ASSERT_TRUE(tellsUntil(1));
  ASSERT_EQ(told()[0].answer.role, "trainee") << told()[0].answer.text;
  desk_->handle(kAda, "test", {.id = 2, .words = {"fulfilled"}});
  ASSERT_TRUE(tellsUntil(3));
  EXPECT_EQ(told()[1].answer.code, "not_joined");
  EXPECT_EQ(told()[1].answer.role, "");
  EXPECT_EQ(told()[2].answer.id, 0U) << "nobody asked: the seat is no more";
  desk_->handle(kAda, "test", {.id = 3, .words = {"fulfilled"}});
  EXPECT_FALSE(answers(4)[3].answer.accepted);
}

TEST_F(DeskTest, WhatCannotBeSentIsSaidInWords) {
  desk_->handle(kAda, "a", {.id = 1, .words = {"signal", std::string(300, 'x')}});
  desk_->handle(kAda, "a", {.id = 2, .words = {"conquer\x1B[31m"}});
  const auto told = answers(2);
  EXPECT_EQ(told[0].answer.text, "a signal has at most 255 bytes, this one has 300");
  EXPECT_EQ(told[1].answer.text, "unknown command 'conquer [31m'; tenon command --help lists all");
}

/// Requests of a page that records.
class DeskRecordingsTest : public ::testing::Test {
 protected:
  DeskAnswer answerTo(const std::string& folder, const std::string& session, const std::string& word) {
    DeskAnswer told;
    const DeskRecordings::Answer answer = [&told](ViewerId, const DeskAnswer& given) { told = given; };
    DeskRecordings(folder, "", test::ownDomain(), answer)
        .handle(kAda, session, {.id = 1, .words = {"record", word}});
    return told;
  }
};

// the page has words of its own for each code
TEST_F(DeskRecordingsTest, EachRefusalHasACode) {
  EXPECT_EQ(answerTo("", "a", "start").code, "record_no_folder");
  EXPECT_EQ(answerTo("/tmp", "", "start").code, "record_none");
  EXPECT_EQ(answerTo("/dev/null/below", "a", "start").code, "record_failed");
  EXPECT_EQ(answerTo("/tmp", "a", "stop").code, "already");
  EXPECT_EQ(answerTo("/tmp", "a", "pause").code, "other");
}

// no server is there, and the gateway ends
TEST_F(DeskRecordingsTest, ARecorderThatHasNotJoinedIsRefusedWithItsReason) {
  const DeskAnswer refused = answerTo("/tmp", "a", "start");
  EXPECT_FALSE(refused.accepted);
  EXPECT_EQ(refused.code, "record_failed");
  EXPECT_FALSE(refused.text.empty());
}

}  // namespace
}  // namespace tenon::console
