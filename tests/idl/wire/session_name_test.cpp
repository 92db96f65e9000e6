#include "idl/wire/session_name.h"

#include <string>

#include <gtest/gtest.h>

namespace tenon::wire {
namespace {

TEST(SessionName, IsATextOfOneTo63Bytes) {
  for (const std::string& name :
       {std::string("test"), std::string("lab 3, morning"), std::string("J\xc3\xbcrg"), std::string(63, 'a')})
    EXPECT_TRUE(checkSessionName(name)) << name;
  EXPECT_FALSE(checkSessionName(""));
  EXPECT_FALSE(checkSessionName("."));
  EXPECT_FALSE(checkSessionName(".."));
  EXPECT_TRUE(checkSessionName("..."));
  EXPECT_FALSE(checkSessionName(std::string(64, 'a')));
  EXPECT_FALSE(checkSessionName(std::string(300, 'a')));
}

TEST(SessionName, IsNoPatternAndNoPathOfPartitions) {
  for (const std::string name : {"a*", "?", "[ab]", "a]", "a\\b", "a/b"})
    EXPECT_FALSE(checkSessionName(name)) << name;
}

TEST(SessionName, HasNeitherControlCharactersNorOtherEncodings) {
  for (const std::string name : {"a\nb", "\x1b[2J", "a\tb", "\x7f", "J\xfcrg"})
    EXPECT_FALSE(checkSessionName(name));
  EXPECT_FALSE(checkSessionName(std::string("a\0b", 3)));
}

TEST(SessionName, OfARefusalIsPrintableAndShort) {
  const auto refused = checkSessionName("\x1b" + std::string(5000, 'a'));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().what.find('\x1b'), std::string::npos);
  EXPECT_LT(refused.error().what.size(), 200U);
  EXPECT_NE(refused.error().what.find("1 to 63 bytes"), std::string::npos);
}

}  // namespace
}  // namespace tenon::wire
