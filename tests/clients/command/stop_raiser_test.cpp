#include "clients/command/stop_raiser.h"

#include <atomic>
#include <functional>
#include <optional>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/types/messages/run.h"
#include "idl/types/stop_truth.h"
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

// else its next raises would count as cleared
TEST(StopRaiserTest, TakesAnotherNameWhereSomebodyElseHasRaisedUnderItsOwn) {
  test::FakeSession server(test::ownDomain(), {});
  auto raiser = StopRaiser::open(test::ownDomain(), "test", "Eve");
  ASSERT_TRUE(raiser) << raiser.error().what;
  auto clears = wire::Writer<EmergencyClear>::open(server.session(), wire::kEmergencyClear);
  ASSERT_TRUE(clears);
  wire::Inbox inbox;
  std::vector<EmergencyStop> heard;
  ASSERT_TRUE(inbox.on<EmergencyStop>(server.session(), wire::kEmergencyStop,
                                      [&](const EmergencyStop& stop) { heard.push_back(stop); }));
  const auto hears = [&](std::size_t raises) {
    return test::dispatchUntil(inbox, [&] {
      (*raiser)->dispatch(milliseconds(0));
      return heard.size() >= raises;
    });
  };
  ASSERT_TRUE((*raiser)->write("a finger"));
  ASSERT_TRUE(hears(1));
  StopTruth truth;
  truth.clear({.client_guid = heard[0].client_guid, .counter = 0xFFFFFFFF});
  ASSERT_TRUE(clears->write({.client_guid = heard[0].client_guid, .counter = 0xFFFFFFFF}));
  for (std::size_t raises = 2; raises < 1000 && !truth.engaged(); ++raises) {
    ASSERT_TRUE((*raiser)->write("a finger"));
    ASSERT_TRUE(hears(raises));
    truth.raise(heard.back());
  }
  EXPECT_TRUE(truth.engaged());
}

// the newest one stands for those before it, so a program that stays has one for those who come later
TEST(StopRaiserTest, OfItsRaisesTheNewestOneAloneIsToldToWhoComesLater) {
  test::FakeSession server(test::ownDomain(), {});
  auto raiser = StopRaiser::open(test::ownDomain(), "test", "Eve");
  ASSERT_TRUE(raiser) << raiser.error().what;
  for (std::uint32_t raise = 1; raise <= 100; ++raise) ASSERT_EQ((*raiser)->write("a finger"), raise);
  wire::Inbox late;
  std::vector<std::uint32_t> heard;
  ASSERT_TRUE(late.on<EmergencyStop>(server.session(), wire::kEmergencyStop,
                                     [&](const EmergencyStop& stop) { heard.push_back(stop.counter); }));
  ASSERT_TRUE(test::dispatchUntil(late, [&] { return !heard.empty(); }));
  EXPECT_EQ(heard, std::vector<std::uint32_t>{100});
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

/// Raises in a thread of its own, until it is over; counts what people are told.
class Raising {
 public:
  Raising(StopRaiser& raiser, RaisePatience patience)
      : thread_([this, &raiser, patience] {
          outcome_ = raiser.raise("a test", patience, stop_, [this](const StopHeard&) { ++told_; });
          is_over_ = true;
        }) {}
  ~Raising() { end(); }
  StopHeard end() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
    return outcome_.value();
  }

  std::atomic<bool> stop_{false}, is_over_{false};
  std::atomic<int> told_{0};

 private:
  Result<StopHeard> outcome_ = fail("not over");
  std::thread thread_;
};

RaisePatience impatient() {
  return {
      .to_find = milliseconds(60'000), .until_told = milliseconds(20), .between_tellings = milliseconds(20)};
}

// on an overloaded machine discovery takes longer than a person waits
TEST(StopRaiserTest, ARaiseIsRepeatedUntilAServerThatComesLateHasConfirmedIt) {
  auto raiser = StopRaiser::open(test::ownDomain(), "late", "Eve");
  ASSERT_TRUE(raiser);
  Raising raising(**raiser, impatient());
  while (raising.told_ < 3) std::this_thread::sleep_for(milliseconds(5));
  EXPECT_FALSE(raising.is_over_);
  Repeater server("late");
  server.announce("late");
  EXPECT_TRUE(test::dispatchUntil(server.inbox_, [&] { return raising.is_over_.load(); }));
  EXPECT_TRUE(raising.end().isConfirmed());
}

TEST(StopRaiserTest, ARaiseThatAServerDoesNotAnswerIsNotGivenUp) {
  Repeater station("hangs"), server("hangs");
  server.repeats_ = false;
  server.announce("hangs");
  auto raiser = StopRaiser::open(test::ownDomain(), "hangs", "Eve");
  ASSERT_TRUE(raiser);
  Raising raising(**raiser, impatient());
  EXPECT_TRUE(test::dispatchUntil(station.inbox_, [&] {
    server.inbox_.dispatch(milliseconds(0));
    return raising.told_ >= 25;
  }));
  EXPECT_FALSE(raising.is_over_);
  const StopHeard heard = raising.end();
  EXPECT_EQ(heard.stations, 1U);
  EXPECT_EQ(heard.silent_sessions, 1U);
  EXPECT_FALSE(heard.isConfirmed() || heard.isObeyedWithoutServer());
}

TEST(StopRaiserTest, ARaiseEndsWhereNobodyIsFoundAndAfterTheTimeThatAScriptGivesIt) {
  const std::atomic<bool> stop{false};
  const auto tellNobody = [](const StopHeard&) {};
  auto of_nobody = StopRaiser::open(test::ownDomain(), "nobody", "Eve");
  ASSERT_TRUE(of_nobody);
  const auto alone = (*of_nobody)->raise("a test", {.to_find = milliseconds(50)}, stop, tellNobody);
  EXPECT_EQ(alone.value().programs, 0U);
  Repeater silent("silent");
  silent.announce("silent");
  auto raiser = StopRaiser::open(test::ownDomain(), "silent", "Eve");
  ASSERT_TRUE(raiser);
  const auto unheard = (*raiser)->raise("a test", {.in_all = milliseconds(400)}, stop, tellNobody);
  EXPECT_FALSE(unheard.value().isConfirmed());
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
              HasSubstr("no program of session 'test' was found on domain 3"));
}

}  // namespace
}  // namespace tenon::command
