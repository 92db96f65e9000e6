#include "server/bake/length.h"

#include <gtest/gtest.h>

namespace tenon::bake {
namespace {

TEST(Length, ReadsNumbersWithUnits) {
  EXPECT_EQ(parseLength("3mm").value_or(-1.0), 0.003);
  EXPECT_EQ(parseLength("0.5 mm").value_or(-1.0), 0.0005);
  EXPECT_EQ(parseLength("0.003m").value_or(-1.0), 0.003);
  EXPECT_EQ(parseLength("2cm").value_or(-1.0), 0.02);
  EXPECT_EQ(parseLength("1in").value_or(-1.0), 0.0254);
  EXPECT_EQ(parseLength("-0.25").value_or(-1.0), -0.25);
}

TEST(Length, InvalidTextIsRefusedAndQuoted) {
  for (const char* text : {"", "mm", "3 furlongs", "nan", "1e999m", "0,5mm"}) {
    const auto length = parseLength(text);
    ASSERT_FALSE(length) << text;
    EXPECT_NE(length.error().what.find(std::string("'") + text + "'"), std::string::npos);
  }
}

}  // namespace
}  // namespace tenon::bake
