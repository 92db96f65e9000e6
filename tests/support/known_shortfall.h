#pragma once

#include <gtest/gtest.h>

namespace tenon::test {

/// For a promise that is known to be broken until its issue: `value` should be at most `promised`, and is at
/// most `known` today. Fails when it is worse, and when the promise is kept at last, so that the test is then
/// made to assert it.
[[nodiscard]] inline testing::AssertionResult knownShortfall(double value, double promised, double known) {
  if (value > known) return testing::AssertionFailure() << value << " is worse than the known " << known;
  if (value <= promised) {
    return testing::AssertionFailure() << value << " is within the promised " << promised
                                       << ": the shortfall is mended, assert the promise here";
  }
  return testing::AssertionSuccess() << value << " instead of the promised " << promised << ", as known";
}

}  // namespace tenon::test
