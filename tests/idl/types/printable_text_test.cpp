#include "idl/types/printable_text.h"

#include <gtest/gtest.h>

namespace tenon {
namespace {

TEST(PrintableText, KeepsWhatCanBeReadAndReplacesTheRest) {
  EXPECT_EQ(printable("grip too high"), "grip too high");
  EXPECT_EQ(printable("G\xC3\xA4nge \xE2\x82\xAC \xF0\x9F\x94\xA7"),
            "G\xC3\xA4nge \xE2\x82\xAC \xF0\x9F\x94\xA7");
  EXPECT_EQ(printable("a\nb\r\n\tc\x1B[31mred"), "a b   c [31mred");
  EXPECT_EQ(printable("ab\xFF\xFE\x80"), "ab???");
  EXPECT_EQ(printable("\xC0\xAF \xED\xA0\x80 \xF4\x90\x80\x80 \xE2\x82"), "?? ??? ???? ??")
      << "overlong, surrogate, beyond, cut";
  EXPECT_EQ(printable("\xC2\x9B"
                      "31m"),
            " 31m")
      << "a control sequence in one character";
  EXPECT_EQ(printable(std::string("a\0b", 3)), "a b");
  EXPECT_EQ(printable("Eve\xE2\x80\xAE (admin)"), "Eve  (admin)") << "nobody is shown backwards";
  EXPECT_EQ(printable("\xE2\x80\xA9\xE2\x81\xA6\xE2\x80\xAF"), "\xE2\x80\xA9 \xE2\x80\xAF");
}

TEST(PrintableText, IsShortenedBetweenCharacters) {
  EXPECT_EQ(shortened("grip", 4), "grip");
  EXPECT_EQ(shortened("grip", 3), "gri");
  EXPECT_EQ(shortened("G\xC3\xA4nge", 2), "G");
  EXPECT_EQ(shortened("G\xC3\xA4nge", 3), "G\xC3\xA4");
  EXPECT_EQ(shortened("\xF0\x9F\x94\xA7", 3), "");
}

}  // namespace
}  // namespace tenon
