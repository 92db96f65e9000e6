#include "idl/types/number_range.h"

#include <gtest/gtest.h>

namespace tenon {
namespace {

TEST(NumberRange, HasBothEndsAndWhatIsBetween) {
  const auto problem = numberFrom(0.0, 1.0);
  for (const char* text : {"0", "1", "0.12", "1e-3", ".5", "-0"}) EXPECT_EQ(problem(text), "") << text;
}

TEST(NumberRange, NamesItselfForWhatIsOutsideOrNoNumber) {
  const auto problem = numberFrom(0.0, 1.0);
  for (const char* text : {"nan", "-nan", "inf", "-inf", "1.001", "-1", "0.5x", "0,5", "", "one"})
    EXPECT_EQ(problem(text), "'" + std::string(text) + "' is not a number from 0 to 1");
  EXPECT_EQ(numberFrom(1.0, 1000.0)("0"), "'0' is not a number from 1 to 1000");
}

}  // namespace
}  // namespace tenon
