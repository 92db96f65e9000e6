#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include <gtest/gtest.h>

#include "server/simulation/environment.h"
#include "tests/server/simulation/busy_scene.h"

namespace tenon::simulation {
namespace {

TEST(EnvironmentCheckpoint, AnInvalidCheckpointIsRejectedAndChangesNothing) {
  const test::BusyScene busy;
  Environment environment(busy.scene, {});
  busy.play(environment, 400);
  const std::vector<std::uint8_t> good = environment.save();
  const std::uint64_t hash = environment.hash();
  for (std::size_t size = 0; size < good.size(); size += 1 + size / 8) {
    EXPECT_FALSE(environment.restore(std::span(good).first(size)));
  }
  std::vector<std::uint8_t> bad = good;
  bad.push_back(0);
  EXPECT_FALSE(environment.restore(bad));
  bad = good;
  bad[0] ^= 0xFF;
  const Result<void> version = environment.restore(bad);
  ASSERT_FALSE(version);
  EXPECT_NE(version.error().what.find("version"), std::string::npos);
  EXPECT_EQ(environment.hash(), hash);

  test::SmallScene other;
  other.object("alone", nullptr, Vector3::Zero());
  Environment elsewhere(other.build(), {});
  EXPECT_FALSE(elsewhere.restore(good));
}

TEST(EnvironmentCheckpoint, RestoreSurvivesCorruptedBytes) {
  const test::BusyScene busy;
  Environment environment(busy.scene, {});
  busy.play(environment, 320);
  const std::vector<std::uint8_t> good = environment.save();
  const std::uint64_t hash = environment.hash();
  std::uint64_t seed = 42;
  int restored = 0;
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<std::uint8_t> bad = good;
    for (int flip = 0; flip < 4; ++flip) {
      seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
      bad[(seed >> 20U) % bad.size()] ^= static_cast<std::uint8_t>(seed >> 56U);
    }
    if (environment.restore(bad)) {
      environment.step();
      ++restored;
    }
  }
  EXPECT_GT(restored, 0) << "no damage was in a number: nothing was tried";
  EXPECT_LT(restored, 200) << "no damage was noticed";
  ASSERT_TRUE(environment.restore(good));
  EXPECT_EQ(environment.hash(), hash);
}

TEST(EnvironmentCheckpoint, ACheckpointWithANumberThatIsNotFiniteIsRejected) {
  const test::BusyScene busy;
  Environment environment(busy.scene, {});
  // the bars have many contacts, and every number costs a restore
  environment.place(busy.bar, Pose(), ObjectStatus::kHidden);
  busy.play(environment, 320);
  // a tick with contacts and with all kinds of force cells
  while (environment.nearPairs().empty() || !environment.objects()[busy.parts[0].value].in_contact) {
    ASSERT_LT(environment.tick(), 3000U);
    busy.play(environment, environment.tick() + 1);
  }
  environment.contribute(busy.parts[0], 1, {Vector3(1, 2, 3), Vector3::Zero()}, 100);
  const std::vector<std::uint8_t> good = environment.save();
  const std::uint64_t hash = environment.hash();
  const std::vector<std::size_t> doubles = environment.savedDoubles();
  ASSERT_GT(doubles.size(), 300U);
  ASSERT_LE(doubles.back() + sizeof(double), good.size());
  const std::array<double, 2> numbers = {std::nan(""), -std::numeric_limits<double>::infinity()};
  for (std::size_t i = 0; i < doubles.size(); ++i) {
    const double number = numbers[i % 2];
    std::vector<std::uint8_t> bad = good;
    std::memcpy(bad.data() + doubles[i], &number, sizeof number);
    const Result<void> restored = environment.restore(bad);
    ASSERT_FALSE(restored) << number << " at byte " << doubles[i];
    ASSERT_EQ(restored.error().what, "checkpoint: contains a number that is not finite") << doubles[i];
  }
  EXPECT_EQ(environment.hash(), hash);
  ASSERT_TRUE(environment.restore(good));
}

TEST(EnvironmentCheckpoint, ACrossingOfTwoPointsIsRejected) {
  const test::BusyScene busy;
  Environment environment(busy.scene, {});
  while (!environment.objects()[busy.bar.value].in_contact) {
    ASSERT_LT(environment.tick(), 3000U);
    busy.play(environment, environment.tick() + 1);
  }
  busy.play(environment, environment.tick() + 20);
  const structures::FeatureShell& of_A = busy.heldBarShape()->features;
  const structures::FeatureShell& of_B = busy.beamShape()->features;
  const auto cornerOf = [](const structures::FeatureShell& features) {
    std::uint32_t corner = 0;
    while (collision::isEdge(features, corner)) ++corner;
    return corner;
  };
  const std::array<std::uint32_t, 2> corners{cornerOf(of_A), cornerOf(of_B)};
  ASSERT_LT(corners[0], of_A.edges().size()) << "a bar has corners";
  ASSERT_LT(corners[1], of_B.edges().size());
  // a crossing: its kind, and a piece of an edge of each bar
  constexpr std::size_t kSize = 1 + 2 * sizeof(std::uint32_t);
  const std::vector<std::uint8_t> good = environment.save();
  int crossings = 0;
  for (std::size_t at = 0; at + kSize <= good.size(); ++at) {
    std::array<std::uint32_t, 2> index{};
    std::memcpy(index.data(), good.data() + at + 1, sizeof index);
    const bool is_crossing = good[at] == static_cast<std::uint8_t>(collision::ContactKind::kCrossing);
    if (!is_crossing || !collision::isEdge(of_A, index[0]) || !collision::isEdge(of_B, index[1]) ||
        index[0] < 2 || index[1] < 2)
      continue;
    std::vector<std::uint8_t> bad = good;
    std::memcpy(bad.data() + at + 1, &corners, sizeof corners);
    EXPECT_FALSE(environment.restore(bad)) << "byte " << at;
    ++crossings;
  }
  EXPECT_GT(crossings, 0);
  EXPECT_TRUE(environment.restore(good));
}

TEST(EnvironmentCheckpoint, SavedDoublesAreWhereTheNumbersAre) {
  test::SmallScene small;
  const ObjectId object = small.object("alone", nullptr, Vector3(0.25, -3.0, 1e-9));
  Environment environment(small.build(), {});
  const std::vector<std::uint8_t> bytes = environment.save();
  std::vector<double> numbers;
  for (const std::size_t at : environment.savedDoubles()) {
    double number = 0.0;
    std::memcpy(&number, bytes.data() + at, sizeof number);
    numbers.push_back(number);
  }
  const Vector3& p_WO = environment.objects()[object.value].X_WO.translation();
  const auto found = std::search(numbers.begin(), numbers.end(), p_WO.data(), p_WO.data() + 3);
  EXPECT_NE(found, numbers.end());
}

}  // namespace
}  // namespace tenon::simulation
