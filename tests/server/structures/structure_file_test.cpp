#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/structures/field_builder.h"
#include "server/structures/haptic_structures.h"
#include "server/structures/shell_builder.h"
#include "tests/support/damaged_structures.h"

namespace tenon::structures {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// Each test has its own folder, removed afterwards.
class StructureFile : public ::testing::Test {
 protected:
  StructureFile() {
    fs::create_directories(folder_);
    const Vector3 corner = Vector3::Constant(0.02);
    const std::array refine{Eigen::AlignedBox3d(Vector3::Zero(), corner)};
    structures_.field =
        buildField([](const Vector3& p) { return p.norm() - 0.02; }, {-corner, corner}, 0.002, refine, 2);
    std::vector<SurfaceSample> samples;
    for (int i = 0; i < 100; ++i) samples.push_back({Vector3(0.001 * i, 0.0, 0.02), -Vector3::UnitZ(), 1e-6});
    structures_.shell = buildShell(samples);
    structures_.info.source = "ball.stl";
    structures_.info.content_hash = "0123";
    structures_.info.meshes = {folder_.parent_path() / "parts" / "ball.stl"};
    structures_.info.unit = 0.0254;
    structures_.info.notes = "A note.\n";
    structures_.info.triangles = 12;
    structures_.info.box_M = {-corner, corner};
  }
  ~StructureFile() override { fs::remove_all(folder_); }

  [[nodiscard]] std::string written() {
    const auto ok = writeStructures(file(), structures_);
    EXPECT_TRUE(ok);
    std::ifstream in(file(), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void overwrite(const std::string& bytes) const {
    std::ofstream(file(), std::ios::binary | std::ios::trunc) << bytes;
  }
  [[nodiscard]] fs::path file() const { return folder_ / "ball.tenon"; }

  fs::path folder_ =
      fs::temp_directory_path() / ("tenon-structure-file-" + std::to_string(::getpid()) +
                                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
  HapticStructures structures_;
};

TEST_F(StructureFile, IsReadAsItWasWritten) {
  (void)written();
  const auto opened = openStructures(file());
  ASSERT_TRUE(opened) << opened.error().what;
  const HapticStructures& read = **opened;
  const auto& a = structures_.field.layout();
  const auto& b = read.field.layout();
  EXPECT_TRUE(std::equal(a.index.begin(), a.index.end(), b.index.begin(), b.index.end()));
  EXPECT_TRUE(std::equal(a.samples.begin(), a.samples.end(), b.samples.begin(), b.samples.end()));
  EXPECT_TRUE(std::equal(a.far.begin(), a.far.end(), b.far.begin(), b.far.end()));
  EXPECT_EQ(read.shell.points().size(), 100U);
  EXPECT_EQ(read.shell.boundingRadius(), structures_.shell.boundingRadius());
  EXPECT_EQ(read.info.source, "ball.stl");
  EXPECT_EQ(read.info.notes, "A note.\n");
  EXPECT_EQ(read.info.meshes, structures_.info.meshes);
  EXPECT_EQ(read.info.unit, 0.0254);
  EXPECT_EQ(read.info.box_M.max(), structures_.info.box_M.max());
  const Vector3 p(0.011, 0.012, 0.013);
  EXPECT_EQ(read.field.sample(p).distance, structures_.field.sample(p).distance);
}

TEST_F(StructureFile, WritingLeavesNoOtherFileBehind) {
  (void)written();
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1);
}

TEST_F(StructureFile, ATruncatedFileIsRefusedWithItsName) {
  const std::string bytes = written();
  for (const std::size_t size : {bytes.size() - 1, bytes.size() / 2, std::size_t{100}, std::size_t{0}}) {
    overwrite(bytes.substr(0, size));
    const auto opened = openStructures(file());
    ASSERT_FALSE(opened) << size;
    EXPECT_THAT(opened.error().what, HasSubstr("ball.tenon"));
  }
}

TEST_F(StructureFile, AFlippedBitAnywhereIsRefused) {
  const std::string bytes = written();
  for (std::size_t i = 0; i < bytes.size(); i += 1 + bytes.size() / 97) {
    std::string bad = bytes;
    bad[i] = static_cast<char>(bad[i] ^ 0x10);
    overwrite(bad);
    EXPECT_FALSE(openStructures(file())) << "byte " << i;
  }
}

TEST_F(StructureFile, AThousandRandomlyDamagedFilesAreRefused) {
  const std::string bytes = written();
  std::mt19937_64 random(2016);
  for (int i = 0; i < 1000; ++i) {
    std::string bad = bytes;
    switch (random() % 3) {
      case 0:
        bad[random() % bad.size()] ^= static_cast<char>(1 << random() % 8);
        break;
      case 1:
        bad.resize(random() % bad.size());
        break;
      default:
        // damage in the header, which contains sizes and offsets
        for (int k = 0; k < 8; ++k) bad[random() % 400] = static_cast<char>(random());
        break;
    }
    if (bad == bytes) continue;
    overwrite(bad);
    const auto opened = openStructures(file());
    ASSERT_FALSE(opened) << i;
    EXPECT_THAT(opened.error().what, HasSubstr("ball.tenon"));
  }
}

/// Reads everything that a field and a shell can be asked for; returns how much that was.
std::size_t useEverything(const HapticStructures& structures) {
  std::size_t used = 0;
  const DistanceField& field = structures.field;
  if (!field.empty()) {
    const Eigen::AlignedBox3d box = field.box();
    const auto ask = [&](const Vector3& p_MP) {
      used += field.sample(p_MP).exact ? 1 : 0;
      used += std::isnan(field.lowerBound(p_MP, 0.001)) ? 0 : 1;
      used += field.voxelAt(p_MP) > 0.0 ? 1 : 0;
    };
    constexpr int kSteps = 12;
    for (int i = 0; i < kSteps * kSteps * kSteps; ++i) {
      const Vector3 fraction(i % kSteps, i / kSteps % kSteps, i / (kSteps * kSteps));
      ask(box.min() + box.sizes().cwiseProduct(fraction + Vector3::Constant(0.37)) / kSteps);
    }
    for (const double limit : {0.0, 1e300, -1e300, std::nan("")}) ask(Vector3::Constant(limit));
    ask(box.min());
    ask(box.max());
  }
  const Pointshell& shell = structures.shell;
  if (shell.empty()) return used;
  for (std::size_t leaf = 0; leaf < shell.leaves().size(); ++leaf) used += shell.pointsOfLeaf(leaf).count;
  for (std::size_t i = 0; i < shell.clusters().size(); ++i) used += shell.leavesOfCluster(i).count;
  for (std::size_t point = 0; point < shell.points().size(); ++point) {
    EXPECT_LT(shell.leafOf(point), shell.leaves().size());
  }
  for (std::size_t k = 0; k < shell.levels().size(); ++k) {
    const ShellLevel& level = shell.levels()[k];
    EXPECT_EQ(shell.areasOfLevel(k).size(), level.first_point + level.point_count);
    for (const float area : shell.areasOfLevel(k)) used += area > 0.0F ? 1 : 0;
  }
  return used;
}

/// Opens `count` damaged files whose checksums are right.
void openDamaged(const fs::path& file, const std::vector<std::uint8_t>& whole, std::uint64_t count) {
  std::uint64_t refused = 0;
  std::uint64_t accepted = 0;
  for (std::uint64_t seed = 0; seed < count; ++seed) {
    SCOPED_TRACE("damage " + std::to_string(seed));
    const auto bytes = test::damagedStructures(whole, seed);
    if (bytes == whole) continue;
    test::writeBytes(file, bytes);
    const auto opened = openStructures(file);
    if (opened) {
      ++accepted;
      (void)useEverything(**opened);
    } else {
      ++refused;
      ASSERT_THAT(opened.error().what, HasSubstr("ball.tenon"));
      ASSERT_THAT(opened.error().what, ::testing::Not(HasSubstr("wrong checksum")));
    }
    ASSERT_FALSE(::testing::Test::HasFailure());
  }
  EXPECT_GT(refused, count / 10);
  EXPECT_GT(accepted, count / 10) << "damage of distances, texts and areas is not detectable";
}

TEST_F(StructureFile, DamageBehindARightChecksumIsRefusedOrHarmless) {
  (void)written();
  openDamaged(file(), test::bytesOf(file()), 4000);
}

class StructureFileNightly : public StructureFile {};

TEST_F(StructureFileNightly, DamageBehindARightChecksumIsRefusedOrHarmless) {
  (void)written();
  openDamaged(file(), test::bytesOf(file()), 100'000);
}

TEST_F(StructureFile, AShellWhoseListsDoNotTileIsRefused) {
  (void)written();
  const std::vector<std::uint8_t> whole = test::bytesOf(file());
  ASSERT_GT(structures_.shell.levels().size(), 0U);
  const auto refusedWith = [&](std::size_t at, std::uint32_t number) {
    std::vector<std::uint8_t> bytes = whole;
    std::memcpy(bytes.data() + at, &number, sizeof number);
    test::correctStructureChecksum(bytes);
    test::writeBytes(file(), bytes);
    const auto opened = openStructures(file());
    return opened ? std::string("accepted") : opened.error().what;
  };
  const auto first = [&whole](std::size_t section) {
    std::uint64_t at = 0;
    std::memcpy(&at, whole.data() + test::kSectionsAt + 8 * section, sizeof at);
    return static_cast<std::size_t>(at);
  };
  // sections 3..6: points, leaves, clusters, levels; a sphere's `first` and `count` follow four floats
  const std::uint32_t leaf_count = structures_.shell.leaves()[0].count;
  EXPECT_THAT(refusedWith(first(4) + 20, leaf_count - 1), HasSubstr("leaves"));
  EXPECT_THAT(refusedWith(first(4) + 16, 1), HasSubstr("leaves"));
  EXPECT_THAT(refusedWith(first(5) + 20, 0), HasSubstr("clusters"));
  // fewer points in a level: the areas of the levels would have fewer entries than there are points
  EXPECT_THAT(refusedWith(first(6) + 4, structures_.shell.levels()[0].point_count - 1),
              HasSubstr("the leaves of a level"));
  EXPECT_THAT(refusedWith(first(3), 0x7FC00000U), HasSubstr("not finite"));
  EXPECT_EQ(refusedWith(first(4) + 20, leaf_count), "accepted");
}

TEST_F(StructureFile, AnotherVersionIsRefusedWithAdviceToBakeAgain) {
  std::string bytes = written();
  for (const char version : {2, 77}) {
    bytes[8] = version;
    overwrite(bytes);
    const auto opened = openStructures(file());
    ASSERT_FALSE(opened);
    EXPECT_THAT(opened.error().what, HasSubstr("version " + std::to_string(version)));
    EXPECT_THAT(opened.error().what, HasSubstr("bake it again"));
  }
}

TEST_F(StructureFile, ErrorsNameMissingFilesAndFolders) {
  EXPECT_THAT(openStructures("/no/such.tenon").error().what, HasSubstr("/no/such.tenon"));
  EXPECT_THAT(writeStructures("/no/such/folder.tenon", structures_).error().what,
              HasSubstr("/no/such/folder"));
  EXPECT_FALSE(openStructures(folder_));
}

}  // namespace
}  // namespace tenon::structures
