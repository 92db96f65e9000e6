#include "clients/command/stop_raiser.h"

#include <functional>
#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/types/messages/run.h"
#include "tests/clients/fake_session.h"

namespace tenon::command {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

// a program that stays, such as a gateway, would repeat it to every station that joins
TEST(StopRaiserTest, WithdrawsARaiseThatItsServerCleared) {
  test::FakeSession server(test::ownDomain(), {});
  auto raiser = StopRaiser::open(test::ownDomain(), "test", "Eve");
  ASSERT_TRUE(raiser) << raiser.error().what;
  wire::Inbox inbox;
  std::optional<EmergencyStop> heard;
  bool withdrawn = false;
  ASSERT_TRUE(inbox.on<EmergencyStop>(server.session(), wire::kEmergencyStop,
                                      [&](const EmergencyStop& stop) { heard = stop; }));
  ASSERT_TRUE(inbox.onGone<EmergencyStop>(server.session(), wire::kEmergencyStop,
                                          [&](const EmergencyStop&) { withdrawn = true; }));
  auto clears = wire::Writer<EmergencyClear>::open(server.session(), wire::kEmergencyClear);
  ASSERT_TRUE(clears);
  ASSERT_TRUE((*raiser)->write("a finger"));
  ASSERT_TRUE(test::dispatchUntil(inbox, [&] {
    (*raiser)->dispatch(milliseconds(0));
    return heard.has_value();
  }));

  auto stranger = test::participant(test::ownDomain());
  wire::Partition of_stranger(stranger, wire::sessionPartition("test"));
  auto others = wire::Writer<EmergencyClear>::open(of_stranger, wire::kEmergencyClear);
  ASSERT_TRUE(others);
  const EmergencyClear clear{.client_guid = heard->client_guid, .counter = heard->counter};
  ASSERT_TRUE(others->write(clear));
  for (int i = 0; i < 10; ++i) {
    (*raiser)->dispatch(milliseconds(20));
    inbox.dispatch(milliseconds(0));
  }
  EXPECT_FALSE(withdrawn) << "a clear of somebody else";

  ASSERT_TRUE(clears->write(clear));
  EXPECT_TRUE(test::dispatchUntil(inbox, [&] {
    (*raiser)->dispatch(milliseconds(0));
    return withdrawn;
  }));
}

/// A program of a session that repeats each raise it hears, as servers and stations do.
class Repeater {
 public:
  explicit Repeater(const std::string& session)
      : bus_(test::participant(test::ownDomain())), session_(bus_, wire::sessionPartition(session)) {
    EXPECT_TRUE(inbox_.on<EmergencyStop>(session_, wire::kEmergencyStop, [this](const EmergencyStop& stop) {
      if (repeats_) (void)stops_.write(stop);
    }));
  }
  void announce(const std::string& session) { EXPECT_TRUE(announces_.write({.session = session})); }

  bool repeats_ = true;
  std::shared_ptr<wire::Participant> bus_;
  wire::Partition lobby_{bus_, wire::kLobby};
  wire::Partition session_;
  wire::Writer<EmergencyStop> stops_ =
      std::move(*wire::Writer<EmergencyStop>::open(session_, wire::kEmergencyStop));
  wire::Writer<SessionAnnounce> announces_ =
      std::move(*wire::Writer<SessionAnnounce>::open(lobby_, wire::kSessionAnnounce));
  wire::Inbox inbox_;
};

// of several sessions one has answered, of which the others know nothing
TEST(StopRaiserTest, IsConfirmedByTheServersOfAllItsSessionsAndByNobodyElse) {
  Repeater station("a"), server_a("a"), server_b("b");
  server_a.repeats_ = server_b.repeats_ = false;
  server_a.announce("a"), server_b.announce("b");
  auto of_a = StopRaiser::open(test::ownDomain(), "a", "Eve");
  auto of_all = StopRaiser::open(test::ownDomain(), "", "Eve");
  ASSERT_TRUE(of_a && of_all);
  const auto hears = [&](StopRaiser& raiser, const std::function<bool(const StopHeard&)>& isSo) {
    const auto number = raiser.write("a test");
    EXPECT_TRUE(number);
    return test::dispatchUntil(station.inbox_, [&] {
      server_a.inbox_.dispatch(milliseconds(0)), server_b.inbox_.dispatch(milliseconds(0));
      raiser.dispatch(milliseconds(0));
      return isSo(*raiser.heard(*number, milliseconds(0)));
    });
  };
  // its server is known, and hangs
  EXPECT_TRUE(hears(**of_a, [](const StopHeard& heard) {
    return heard.stations == 1 && !heard.by_server && heard.silent_sessions == 1;
  }));
  server_a.repeats_ = true;
  EXPECT_TRUE(hears(**of_a, [](const StopHeard& heard) { return heard.isConfirmed(); }));
  EXPECT_TRUE(hears(**of_all, [](const StopHeard& heard) {
    return heard.stations == 1 && heard.by_server && heard.silent_sessions == 1 && !heard.isConfirmed();
  }));
  server_b.repeats_ = true;
  EXPECT_TRUE(hears(**of_all, [](const StopHeard& heard) { return heard.isConfirmed(); }));
}

TEST(StopOutcome, SaysWhetherItMayBeReliedOn) {
  EXPECT_EQ(outcomeOf({.programs = 2, .by_server = true, .acknowledged = false}, 3, "test").value(),
            "accepted");
  EXPECT_THAT(outcomeOf({.programs = 2, .by_server = true, .silent_sessions = 1}, 3, "").value(),
              HasSubstr("not by all: of 1 session no server has answered"));
  EXPECT_THAT(outcomeOf({.programs = 3, .stations = 2}, 3, "test").value(),
              HasSubstr("2 stations have stopped; no server has answered"));
  EXPECT_THAT(outcomeOf({.programs = 3, .stations = 1, .acknowledged = false}, 3, "test").error().what,
              HasSubstr("1 station has stopped, and not all that listen have acknowledged it"));
  EXPECT_THAT(outcomeOf({.programs = 1}, 3, "test").error().what,
              HasSubstr("sent to 1 program, and no station has obeyed it; no server has answered"));
  EXPECT_THAT(outcomeOf({}, 3, "test").error().what,
              HasSubstr("no program of session 'test' runs on domain 3"));
}

}  // namespace
}  // namespace tenon::command
