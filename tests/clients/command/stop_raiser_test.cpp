#include "clients/command/stop_raiser.h"

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

TEST(StopOutcome, SaysWhetherItMayBeReliedOn) {
  EXPECT_EQ(outcomeOf({.programs = 2, .by_server = true, .acknowledged = false}, 3, "test").value(),
            "accepted");
  EXPECT_THAT(outcomeOf({.programs = 1}, 3, "test").value(), HasSubstr("sent to 1 program; no server"));
  EXPECT_THAT(outcomeOf({.programs = 2, .acknowledged = false}, 3, "test").error().what,
              HasSubstr("sent to 2 programs, and not all of them have acknowledged it"));
  EXPECT_THAT(outcomeOf({}, 3, "test").error().what,
              HasSubstr("no program of session 'test' runs on domain 3"));
}

}  // namespace
}  // namespace tenon::command
