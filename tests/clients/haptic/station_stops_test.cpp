#include "clients/haptic/station_stops.h"

#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/clients/haptic/joined_station.h"

namespace tenon::haptic {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

const EmergencyStop kRaise{.client_guid = "somebody", .counter = 1, .who = "Eve", .reason = "a finger"};
const EmergencyClear kClear{
    .client_guid = "somebody", .counter = 1, .who = "Bob", .reason = "the finger is out"};

/// A program of its own that raises stops, and says what it wants.
class Stranger {
 public:
  Stranger()
      : bus_(test::participant(test::ownDomain())),
        session_(bus_, wire::sessionPartition("test")),
        raises_(wire::Writer<EmergencyStop>::open(session_, wire::kEmergencyStop).value()),
        clears_(wire::Writer<EmergencyClear>::open(session_, wire::kEmergencyClear).value()) {}
  void raise(const EmergencyStop& stop) { EXPECT_TRUE(raises_.write(stop)); }
  void clear(const EmergencyClear& cleared) { EXPECT_TRUE(clears_.write(cleared)); }
  [[nodiscard]] bool isHeardByAnother() { return clears_.matchedReaders() > 0; }

 private:
  std::shared_ptr<wire::Participant> bus_;
  wire::Partition session_;
  wire::Writer<EmergencyStop> raises_;
  wire::Writer<EmergencyClear> clears_;
};

class StationStopsTest : public JoinedStation {
 protected:
  void subscribe(const std::string& to_continue = "") {
    stops_ = std::make_unique<StationStops>(
        *link_,
        StationStops::Callbacks{.changed = [this](const StopSignal& signal) { heard_.push_back(signal); },
                                .print = [this](const std::string& text) { printed_.push_back(text); }},
        to_continue);
    ASSERT_TRUE(stops_->subscribe());
  }
  [[nodiscard]] bool isStopped() const { return !heard_.empty() && heard_.back().engaged; }
  void serverClears(const std::string& reason = kClear.reason, std::uint32_t counter = kClear.counter) {
    if (!clears_)
      clears_ = std::make_unique<wire::Writer<EmergencyClear>>(
          wire::Writer<EmergencyClear>::open(server_.session(), wire::kEmergencyClear).value());
    EmergencyClear clear = kClear;
    clear.reason = reason;
    clear.counter = counter;
    ASSERT_TRUE(clears_->write(clear));
  }

  std::unique_ptr<StationStops> stops_;
  std::unique_ptr<wire::Writer<EmergencyClear>> clears_;
  std::vector<StopSignal> heard_;
  std::vector<std::string> printed_;
};

TEST_F(StationStopsTest, AnybodyStopsItAndItsServerAloneContinuesIt) {
  subscribe("press the device's arming button to continue at this station");
  Stranger stranger;
  stranger.raise(kRaise);
  ASSERT_TRUE(hearUntil([&] { return isStopped(); }));
  EXPECT_EQ(heard_.back().raised, 1U);
  EXPECT_THAT(printed_, Contains("emergency stop by Eve: a finger"));

  stranger.clear(kClear);
  hear();
  EXPECT_TRUE(isStopped()) << "a clear of somebody else";
  EXPECT_EQ(heard_.size(), 1U);

  serverClears();
  ASSERT_TRUE(hearUntil([&] { return !isStopped(); }));
  EXPECT_EQ(heard_.back().raised, 1U);
  EXPECT_THAT(printed_, Contains("emergency stop cleared by Bob: the finger is out"));
  EXPECT_THAT(printed_, Contains("press the device's arming button to continue at this station"));
}

TEST_F(StationStopsTest, SaysNoReasonWhereNoneWasGiven) {
  subscribe();
  Stranger stranger;
  EmergencyStop raise = kRaise;
  raise.reason.clear();
  stranger.raise(raise);
  ASSERT_TRUE(hearUntil([&] { return isStopped(); }));
  serverClears("");
  ASSERT_TRUE(hearUntil([&] { return !isStopped(); }));
  EXPECT_THAT(printed_, ElementsAre("emergency stop by Eve", "emergency stop cleared by Bob"));
}

TEST_F(StationStopsTest, SaysNothingMoreWhereNobodyHasToPress) {
  subscribe();
  Stranger stranger;
  stranger.raise(kRaise);
  ASSERT_TRUE(hearUntil([&] { return isStopped(); }));
  serverClears();
  ASSERT_TRUE(hearUntil([&] { return !isStopped(); }));
  EXPECT_THAT(printed_, Not(Contains(HasSubstr("to continue"))));
}

TEST_F(StationStopsTest, ARaiseIsToldOnceHoweverOftenItComes) {
  subscribe();
  Stranger one, other;
  one.raise(kRaise);
  other.raise(kRaise);
  EmergencyStop next = kRaise;
  next.counter = 2;
  other.raise(next);
  ASSERT_TRUE(hearUntil([&] { return isStopped() && heard_.back().raised == 2; }));
  hear();
  EXPECT_EQ(heard_.size(), 2U);
}

TEST_F(StationStopsTest, AClearLeavesLaterRaisesAndThoseOfOthers) {
  subscribe();
  Stranger stranger;
  EmergencyStop second = kRaise, other = kRaise;
  second.counter = 2;
  other.client_guid = "somebody else";
  for (const EmergencyStop& raise : {kRaise, second, other}) stranger.raise(raise);
  ASSERT_TRUE(hearUntil([&] { return isStopped() && heard_.back().raised == 3; }));
  serverClears();
  hear();
  EXPECT_TRUE(isStopped());
  serverClears("the finger is out", 2);
  hear();
  EXPECT_EQ(heard_.size(), 4U) << "the second one is cleared";
  EXPECT_TRUE(isStopped());
}

// a clear may be faster than the raise that it names
TEST_F(StationStopsTest, AClearThatComesFirstStillNamesItsRaise) {
  subscribe();
  serverClears();
  hear();
  Stranger stranger;
  stranger.raise(kRaise);
  hear();
  EXPECT_FALSE(isStopped());
}

// who raised it has ended, a server starts anew: it hears of the stop from the station
TEST_F(StationStopsTest, RepeatsForThoseWhoComeLaterWhatItObeysAndNothingElse) {
  subscribe();
  {
    Stranger stranger;
    stranger.raise(kRaise);
    ASSERT_TRUE(hearUntil([&] { return isStopped(); }));
  }
  wire::Inbox late;
  std::map<std::uint32_t, std::string> standing;
  ASSERT_TRUE(late.on<EmergencyStop>(server_.session(), wire::kEmergencyStop,
                                     [&](const EmergencyStop& stop) { standing[stop.counter] = stop.who; }));
  ASSERT_TRUE(late.onGone<EmergencyStop>(server_.session(), wire::kEmergencyStop,
                                         [&](const EmergencyStop& stop) { standing.erase(stop.counter); }));
  ASSERT_TRUE(test::dispatchUntil(late, [&] { return standing.contains(1); }));
  EXPECT_EQ(standing[1], "Eve");
  serverClears();
  ASSERT_TRUE(hearUntil([&] { return !isStopped(); }));
  ASSERT_TRUE(test::dispatchUntil(late, [&] { return standing.empty(); })) << "it is withdrawn";
}

}  // namespace
}  // namespace tenon::haptic
