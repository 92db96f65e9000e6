#include "idl/wire/joining_names.h"

#include <string>

#include <gtest/gtest.h>

#include "idl/types/messages/session.h"
#include "idl/wire/codec.h"

namespace tenon::wire {
namespace {

TEST(JoiningNames, AreThoseThatCanBeSent) {
  for (std::size_t size = 1; size < 100; ++size) {
    const std::string name(size, 'x');
    EXPECT_EQ(checkPersonName(name).has_value(), encode(Join{.name = name}).has_value()) << size;
    EXPECT_EQ(checkPersonName(name).has_value(), encode(Presence{.name = name}).has_value()) << size;
    EXPECT_EQ(checkHandName(name).has_value(), encode(Join{.hands = {name}}).has_value()) << size;
  }
}

TEST(JoiningNames, AreWordsForPeople) {
  EXPECT_TRUE(checkPersonName("J\xc3\xbcrg, lab 3"));
  for (const std::string name : {"", "a\nb", "\x1b[2J", "J\xfcrg"}) EXPECT_FALSE(checkPersonName(name));
  const auto refused = checkPersonName(std::string(300, 'x'));
  ASSERT_FALSE(refused);
  EXPECT_LT(refused.error().what.size(), 200U);
  EXPECT_NE(refused.error().what.find("no name of a person: expected 1 to 63 bytes"), std::string::npos);
}

}  // namespace
}  // namespace tenon::wire
