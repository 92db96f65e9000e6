#include "tests/support/damaged_structures.h"

#include <cmath>
#include <filesystem>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/collision/pair_query.h"
#include "tests/server/collision/baked_pair.h"
#include "tests/support/analytic_structures.h"

namespace tenon::collision {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// Queries in both directions, with all levels and with a budget, at poses from apart to deep inside; then
/// again from the list.
void queryAll(const structures::HapticStructures& a, const structures::HapticStructures& b,
              PairQueryResult& result) {
  for (const double z : {0.045, 0.019, 0.0, -0.01}) {
    for (const std::uint32_t budget : {0xFFFFFFFFU, 60U}) {
      PairQuery query{&a.shell, &b.field, Pose(Vector3(0.003, -0.002, z), expRotation({0.1, 0.2, 0.3})),
                      Pose()};
      query.margin = 0.003;
      query.reduce = budget == 60U;
      query.correct_ridges = true;
      query.budget = budget;
      queryPair(query, result);
      for (const Contact& contact : result.contacts) ASSERT_LT(contact.point, a.shell.points().size());
      resampleContacts(query, 0.0005, result);
    }
  }
}

/// Queries `count` damaged files whose checksums are right against an undamaged sphere.
void queryDamaged(std::uint64_t count) {
  const fs::path file =
      fs::temp_directory_path() / ("tenon-damaged-" + std::to_string(::getpid()) + ".tenon");
  const auto sphere = test::sphereStructures(0.02, 0.002, 0.003);
  ASSERT_TRUE(structures::writeStructures(file, *sphere));
  const std::vector<std::uint8_t> whole = test::bytesOf(file);
  const auto result = std::make_unique<PairQueryResult>();
  std::uint64_t accepted = 0;
  for (std::uint64_t seed = 0; seed < count; ++seed) {
    SCOPED_TRACE("damage " + std::to_string(seed));
    test::writeBytes(file, test::damagedStructures(whole, seed));
    const auto damaged = structures::openStructures(file);
    if (!damaged) {
      ASSERT_THAT(damaged.error().what, HasSubstr(file.string()));
      continue;
    }
    ++accepted;
    ASSERT_NO_FATAL_FAILURE(queryAll(**damaged, *sphere, *result));
    ASSERT_NO_FATAL_FAILURE(queryAll(*sphere, **damaged, *result));
    ASSERT_NO_FATAL_FAILURE(queryAll(**damaged, **damaged, *result));
  }
  EXPECT_GT(accepted, count / 10);
  fs::remove(file);
}

// What passes a reader's checks must be safe to query, though its contacts are those of another shape.
TEST(DamagedStructures, AreRefusedOrSafeToQuery) { queryDamaged(1500); }

TEST(DamagedStructuresNightly, AreRefusedOrSafeToQuery) { queryDamaged(50'000); }

}  // namespace
}  // namespace tenon::collision
