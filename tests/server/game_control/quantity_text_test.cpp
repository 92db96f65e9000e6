#include "server/game_control/quantity_text.h"

#include <gtest/gtest.h>

namespace tenon::game_control {
namespace {

TEST(QuantityText, PercentagesHaveNoExponent) {
  EXPECT_EQ(inPercent(1.0), "100 %");
  EXPECT_EQ(inPercent(0.123), "12 %");
  EXPECT_EQ(inPercent(0.0996), "10 %");
  EXPECT_EQ(inPercent(0.0994), "9.9 %");
  EXPECT_EQ(inPercent(0.00042), "0.042 %");
  EXPECT_EQ(inPercent(0.00001), "0.001 %");
  EXPECT_EQ(inPercent(4e-7), "less than 0.001 %");
  EXPECT_EQ(inPercent(0.0), "0 %");
}

}  // namespace
}  // namespace tenon::game_control
