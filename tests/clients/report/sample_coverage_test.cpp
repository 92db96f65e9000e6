#include "clients/report/sample_coverage.h"

#include <gtest/gtest.h>

#include "idl/wire/topics.h"

namespace tenon::report {
namespace {

// a recording without all streams has the strongest manifold of each 10 ticks from 10 k on, here that of tick
// 1000 and of the other tens one that is none of the last tick of a period of PublishedSamples
TEST(SampleCoverage, OfEachTenTicksOneManifoldIsEnough) {
  SampleCoverage coverage;
  coverage.add({1, 1000, {{"HandManifold", 1000}}});
  coverage.add({1001, 2000, {{"HandManifold", 1000}}});
  coverage.add({2001, 2009, {{"HandManifold", 9}}});
  for (Tick ten = 0; ten <= 200; ++ten) coverage.addManifold(HandId{0}, ten == 100 ? 1000 : 10 * ten + 3);
  const SampleCount count = coverage.between(wire::kHandManifold.name, 1, 2009);
  EXPECT_EQ(count.missing(), 0U);
  EXPECT_EQ(count.published, 2009U);
}

TEST(SampleCoverage, TenTicksWithoutAManifoldAreMissing) {
  SampleCoverage coverage;
  coverage.add({1, 1000, {{"HandManifold", 1000}}});
  for (Tick tick = 1; tick <= 1000; tick += 10)
    if (tick != 501) coverage.addManifold(HandId{0}, tick);
  EXPECT_EQ(coverage.between(wire::kHandManifold.name, 1, 1000).missing(), 10U);
}

}  // namespace
}  // namespace tenon::report
