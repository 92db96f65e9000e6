#include "server/session/tick_io.h"

#include <span>
#include <vector>

#include <gtest/gtest.h>

namespace tenon::session {
namespace {

TickInput fullInput() {
  TickInput input;
  input.tick = 123'456'789'012;
  for (std::uint32_t i = 0; i < kMaxHands; ++i) {
    input.readings.push_back({.hand = HandId{i},
                              .seq = 7 + i,
                              .active = i % 2 == 0,
                              .X_WH = Pose(Vector3(0.1 * i, -1, 2), Quaternion(0.5, 0.5, -0.5, 0.5)),
                              .V_WH = {Vector3(1, 2, i), Vector3(-3, 0, 0)},
                              .buttons = i});
  }
  for (std::uint32_t i = 0; i < kMaxChanges; ++i) {
    Change change{.kind = static_cast<ChangeKind>(i % 10), .hand = HandId{i}, .object = ObjectId{2 * i}};
    change.index = i;
    change.lifetime_ticks = 100 + i;
    change.value = -0.25 * i;
    change.stiffness = {100.0 * i, 2.0 * i};
    change.game = {CommandKind::kSignal, HandId{i}, i, 3.5};
    change.F_Oo_W = {Vector3(i, 0, 1), Vector3(0, i, 0)};
    change.X_WO = Pose(Vector3(0, 0, i));
    input.changes.push_back(change);
  }
  return input;
}

std::vector<std::uint8_t> bytesOf(const TickInput& input) {
  std::vector<std::uint8_t> bytes;
  appendBytes(input, bytes);
  return bytes;
}

TEST(TickIo, TickInputIsReadBackBitEqual) {
  const TickInput input = fullInput();
  const auto read = readTickInput(bytesOf(input));
  ASSERT_TRUE(read) << read.error().what;
  EXPECT_EQ(read->tick, input.tick);
  ASSERT_EQ(read->readings.size(), kMaxHands);
  ASSERT_EQ(read->changes.size(), kMaxChanges);
  EXPECT_EQ(read->readings[3].hand, HandId{3});
  EXPECT_EQ(read->readings[3].seq, 10U);
  EXPECT_FALSE(read->readings[3].active);
  EXPECT_TRUE(read->readings[3].X_WH == input.readings[3].X_WH);
  EXPECT_EQ(read->readings[3].V_WH.linear, Vector3(1, 2, 3));
  EXPECT_EQ(read->changes[5].stiffness.rotational, 10.0);
  EXPECT_EQ(read->changes[5].game.signal, 5U);
  EXPECT_EQ(read->changes[5].F_Oo_W.torque, Vector3(0, 5, 0));
  EXPECT_EQ(bytesOf(*read), bytesOf(input)) << "every field is written";
}

TEST(TickIo, ATickWithoutInputTakesAFewBytes) {
  TickInput input;
  input.tick = 5;
  const auto bytes = bytesOf(input);
  EXPECT_LE(bytes.size(), 16U);
  const auto read = readTickInput(bytes);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->tick, 5U);
  EXPECT_TRUE(read->readings.empty());
  EXPECT_TRUE(read->changes.empty());
}

TEST(TickIo, TruncatedAndExtendedBytesAreRefused) {
  auto bytes = bytesOf(fullInput());
  for (std::size_t size = 0; size < bytes.size(); ++size)
    ASSERT_FALSE(readTickInput(std::span(bytes).first(size))) << size;
  bytes.push_back(0);
  const auto longer = readTickInput(bytes);
  ASSERT_FALSE(longer);
  EXPECT_NE(longer.error().what.find("damaged"), std::string::npos) << longer.error().what;
}

TEST(TickIo, ListsAboveTheirCapacityAreRefused) {
  auto bytes = bytesOf(fullInput());
  constexpr std::size_t kCountOfReadings = sizeof(Tick);
  ASSERT_EQ(bytes[kCountOfReadings], kMaxHands);
  bytes[kCountOfReadings] = kMaxHands + 1;
  EXPECT_FALSE(readTickInput(bytes));
  bytes[kCountOfReadings] = 255;
  EXPECT_FALSE(readTickInput(bytes));
}

}  // namespace
}  // namespace tenon::session
