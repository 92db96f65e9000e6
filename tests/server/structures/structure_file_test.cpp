#include <algorithm>
#include <fstream>
#include <iterator>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/structures/structure_file_fixture.h"
#include "tests/support/damaged_structures.h"

namespace tenon::structures {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

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
  ASSERT_EQ(read.features.edges().size(), 100U);
  EXPECT_EQ(read.features.edges()[99].half_M, structures_.features.edges()[99].half_M);
  EXPECT_EQ(read.features.edges()[99].into_M, structures_.features.edges()[99].into_M);
  EXPECT_EQ(read.features.points().points()[99].p_MP, structures_.features.points().points()[99].p_MP);
  EXPECT_EQ(read.features.longestHalf(), structures_.features.longestHalf());
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

TEST_F(StructureFile, AFileThatChangesAfterItWasReadChangesNothing) {
  (void)written();
  const auto opened = openStructures(file());
  ASSERT_TRUE(opened);
  const Vector3 p(0.011, 0.012, 0.013);
  const double distance = (*opened)->field.sample(p).distance;
  {
    std::fstream out(file(), std::ios::binary | std::ios::in | std::ios::out);
    out << std::string(fs::file_size(file()), '\x7F');
  }
  fs::resize_file(file(), 10);
  EXPECT_EQ((*opened)->field.sample(p).distance, distance);
  EXPECT_GT(useEverything(**opened), 0U);
}

TEST_F(StructureFile, AMeshThatIsALinkKeepsItsName) {
  fs::create_directories(folder_ / "store");
  std::ofstream(folder_ / "store" / "7f3a") << "solid";
  fs::create_symlink("store/7f3a", folder_ / "ball.stl");
  structures_.info.meshes = {folder_ / "ball.stl"};
  (void)written();
  const auto opened = openStructures(file());
  ASSERT_TRUE(opened);
  EXPECT_EQ((*opened)->info.meshes, structures_.info.meshes);
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
