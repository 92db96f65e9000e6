#include "server/session/accepted_commands.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tenon::session {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

TEST(AcceptedCommands, AreToldWithTheirSenderWhereAStopHasDroppedThem) {
  AcceptedCommands commands;
  commands.add(commandText({.kind = CommandKind::kSkipStep}, "Ada"));
  commands.add(commandText({.kind = CommandKind::kGoToStep, .text = "insert_peg"}, "Bob"));
  commands.update({.taken = 2, .waiting = 1}, false);
  EXPECT_THAT(commands.takeDropped(), IsEmpty()) << "one was carried out";
  commands.add(commandText({.kind = CommandKind::kBack}, "Cy"));
  commands.update({.taken = 3, .waiting = 0, .dropped = 2}, false);
  EXPECT_THAT(commands.takeDropped(),
              ElementsAre(AllOf(StartsWith("Bob: goto insert_peg ("), HasSubstr("emergency stop")),
                          StartsWith("Cy: back (")));
  EXPECT_EQ(commands.waiting(), 0U);
  commands.add("Ada: reset");
  commands.update({.taken = 4, .waiting = 0, .dropped = 2}, false);
  EXPECT_THAT(commands.takeDropped(), IsEmpty());
}

TEST(AcceptedCommands, AreToldOnceWhereTheRunHasEndedBeforeTheirTick) {
  AcceptedCommands commands;
  for (const char* text : {"Ada: skip", "Ada: fulfilled", "Bob: reset"}) commands.add(text);
  commands.update({.taken = 2, .waiting = 0, .dropped = 1}, true);  // the third one meets no tick
  EXPECT_THAT(commands.takeDropped(), ElementsAre("Ada: fulfilled (the run has ended before its tick)",
                                                  "Bob: reset (the run has ended before its tick)"));
  commands.update({.taken = 2, .waiting = 0, .dropped = 1}, true);
  EXPECT_THAT(commands.takeDropped(), IsEmpty());
}

// of the tick that a resumed server begins with; what its simulation had dropped before that was told then
TEST(AcceptedCommands, OfAServerThatWasKilledHaveNoNames) {
  AcceptedCommands commands;
  commands.update({.taken = 0, .waiting = 2, .dropped = 5}, false);
  EXPECT_EQ(commands.waiting(), 2U);
  commands.add("Ada: skip");
  commands.update({.taken = 1, .waiting = 2, .dropped = 5}, false);
  EXPECT_THAT(commands.takeDropped(), IsEmpty());
  commands.update({.taken = 1, .waiting = 0, .dropped = 7}, false);
  EXPECT_THAT(commands.takeDropped(),
              ElementsAre(StartsWith("a command from before the restart"), StartsWith("Ada: skip (")));
}

}  // namespace
}  // namespace tenon::session
