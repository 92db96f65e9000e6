#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/structures/structure_file_fixture.h"
#include "tests/support/analytic_structures.h"
#include "tests/support/damaged_structures.h"

namespace tenon::structures {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// A structure file with single numbers replaced, its checksum right.
class ChangedFile {
 public:
  ChangedFile(fs::path file) : file_(std::move(file)), whole_(test::bytesOf(file_)) {}  // NOLINT

  /// [bytes] of the first element of a section, and the number of its elements.
  [[nodiscard]] std::size_t first(std::size_t section) const {
    return number(test::kSectionsAt + 8 * section);
  }
  [[nodiscard]] std::size_t count(std::size_t section) const {
    return number(test::kSectionsAt + 8 * (test::kSections + section));
  }
  /// What is said of the file with `value` at byte `at`; "accepted" when nothing.
  template <typename T>
  std::string with(std::size_t at, T value) {
    std::vector<std::uint8_t> bytes = whole_;
    std::memcpy(bytes.data() + at, &value, sizeof value);
    test::correctStructureChecksum(bytes);
    test::writeBytes(file_, bytes);
    const auto opened = openStructures(file_);
    return opened ? std::string("accepted") : opened.error().what;
  }
  template <typename T>
  [[nodiscard]] T at(std::size_t at) const {
    T value{};
    std::memcpy(&value, whole_.data() + at, sizeof value);
    return value;
  }

 private:
  [[nodiscard]] std::size_t number(std::size_t at) const {
    return static_cast<std::size_t>(this->at<std::uint64_t>(at));
  }
  fs::path file_;
  std::vector<std::uint8_t> whole_;
};

class CraftedStructureFile : public StructureFile {};

// sections: 0 index, 1 samples, 2 far, 3 points, 4 leaves, 5 clusters, 6 levels, 11 dilations; 12 to 15 the
// lists of features as 3 to 6, 16 edges; 18 to 21 the planes of valleys: index, bricks, cells, planes
TEST_F(CraftedStructureFile, AShellWhoseListsDoNotTileIsRefused) {
  (void)written();
  ChangedFile file(this->file());
  const ShellLevel& level = structures_.shell.levels()[0];
  // a sphere's `first` and `count` follow four floats
  const std::uint32_t leaf_count = structures_.shell.leaves()[0].count;
  EXPECT_THAT(file.with(file.first(4) + 20, leaf_count - 1), HasSubstr("leaves"));
  EXPECT_THAT(file.with(file.first(4) + 16, 1U), HasSubstr("leaves"));
  EXPECT_THAT(file.with(file.first(5) + 20, 0U), HasSubstr("clusters"));
  // fewer points in a level: the areas of the levels would have fewer entries than there are points
  EXPECT_THAT(file.with(file.first(6) + 4, level.point_count - 1), HasSubstr("the leaves of a level"));
  EXPECT_EQ(file.with(file.first(4) + 20, leaf_count), "accepted");
}

TEST_F(CraftedStructureFile, AShellWithNumbersThatAreNoneIsRefused) {
  (void)written();
  ChangedFile file(this->file());
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinite = std::numeric_limits<float>::infinity();
  for (const float bad : {nan, infinite, -infinite}) {
    for (std::size_t k = 0; k < 7; ++k)
      EXPECT_THAT(file.with(file.first(3) + 4 * k, bad), HasSubstr("a point is"));
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_THAT(file.with(file.first(4) + 4 * k, bad), HasSubstr("a leaf's sphere"));
      EXPECT_THAT(file.with(file.first(5) + 4 * k, bad), HasSubstr("a cluster's sphere"));
    }
    for (std::size_t k = 0; k < 2; ++k)
      EXPECT_THAT(file.with(file.first(6) + 24 + 4 * k, bad), HasSubstr("spacing or the area"));
  }
  EXPECT_THAT(file.with(file.first(3) + 24, -1e-6F), HasSubstr("negative area"));
}

TEST_F(CraftedStructureFile, FeaturesWithNumbersThatAreNoneAreRefused) {
  (void)written();
  ChangedFile file(this->file());
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinite = std::numeric_limits<float>::infinity();
  for (const float bad : {nan, infinite, -infinite, 1e30F}) {
    EXPECT_THAT(file.with(file.first(12), bad), HasSubstr("feature shell is damaged"));
    for (std::size_t k = 0; k < sizeof(FeatureEdge) / 4; ++k)
      EXPECT_THAT(file.with(file.first(16) + 4 * k, bad), HasSubstr("an edge is not plausible"));
  }
  EXPECT_THAT(file.with(file.first(13) + 16, 1U), HasSubstr("feature shell is damaged"));
}

TEST_F(CraftedStructureFile, ASphereThatDoesNotContainItsPointsIsRefused) {
  (void)written();
  ChangedFile file(this->file());
  const float radius = structures_.shell.leaves()[0].radius;
  EXPECT_THAT(file.with(file.first(4) + 12, 0.9F * radius), HasSubstr("a leaf's sphere"));
  EXPECT_THAT(file.with(file.first(4) + 12, -radius), HasSubstr("a leaf's sphere"));
  EXPECT_THAT(file.with(file.first(5) + 12, 0.9F * structures_.shell.clusters()[0].radius),
              HasSubstr("a cluster's sphere"));
  EXPECT_THAT(file.with(file.first(3), structures_.shell.points()[0].p_MP.x() + 0.05F), HasSubstr("sphere"));
  EXPECT_EQ(file.with(file.first(4) + 12, 1.1F * radius), "accepted") << "it prunes less";
}

TEST_F(CraftedStructureFile, AnIndexThatDoesNotMatchItsBricksIsRefused) {
  (void)written();
  ChangedFile file(this->file());
  using Entry = DistanceField::Entry;
  std::size_t brick = 0;
  std::size_t refined = 0;
  for (std::size_t i = 0; i < structures_.field.layout().far.size(); ++i) {
    const Entry entry = structures_.field.layout().index[i];
    if (brick == 0 && entry > 0 && entry < DistanceField::kRefined) brick = i;
    if (entry >= DistanceField::kRefined) refined = i;
  }
  ASSERT_GT(brick, 0U);
  ASSERT_GT(refined, 0U);
  const auto at = [&file](std::size_t entry) { return file.first(0) + sizeof(Entry) * entry; };
  const Entry number = structures_.field.layout().index[brick];
  const Entry block = structures_.field.layout().index[refined];
  const auto order = HasSubstr("out of order or out of range");
  for (const Entry bad : {number - 1, number + 1, -3, DistanceField::kMaxBricks})
    EXPECT_THAT(file.with(at(brick), bad), order);
  EXPECT_THAT(file.with(at(brick), DistanceField::kFarOutside), order) << "the next one is out of order";
  // a block that begins elsewhere: before the blocks, within another one, at itself, beyond the end
  for (const Entry bad : {DistanceField::kRefined, block + 1, block - 9, block + 900'000'000})
    EXPECT_THAT(file.with(at(refined), bad), order);
  const auto child = static_cast<std::size_t>(block - DistanceField::kRefined);
  EXPECT_THAT(file.with(at(child), block), order) << "a child is not refined again";
  EXPECT_THAT(file.with(at(child + 8), DistanceField::kFarInside), order)
      << "a refined brick has samples of its own";
  EXPECT_EQ(file.with(at(brick), number), "accepted");
}

TEST_F(CraftedStructureFile, CountsThatDoNotMatchAreRefused) {
  (void)written();
  ChangedFile file(this->file());
  const auto count = [](std::size_t section) { return test::kSectionsAt + 8 * (test::kSections + section); };
  for (const std::size_t section : {0U, 1U, 2U, 3U, 4U, 5U, 6U, 12U, 13U, 14U, 15U, 16U}) {
    const std::uint64_t whole = file.count(section);
    const std::uint64_t step = section == 1 ? DistanceField::kBrickSamples : 1;
    EXPECT_NE(file.with(count(section), whole - step), "accepted") << section;
    EXPECT_NE(file.with(count(section), std::uint64_t{0}), "accepted") << section;
    EXPECT_NE(file.with(count(section), std::numeric_limits<std::uint64_t>::max()), "accepted") << section;
    EXPECT_EQ(file.with(count(section), whole), "accepted") << section;
  }
}

TEST_F(CraftedStructureFile, AHeaderWithNumbersThatAreNoneIsRefused) {
  (void)written();
  ChangedFile file(this->file());
  // p_MoFo, voxel, band, margin, dilation, slope; then, behind the sections and two counts, times, areas, the
  // unit and the box
  std::vector<std::size_t> doubles;
  for (std::size_t at = 32; at < 96; at += 8) doubles.push_back(at);
  for (std::size_t at = test::kSectionsAt + 16 * test::kSections + 16; at < test::kStructureFileHeader;
       at += 8)
    doubles.push_back(at);
  ASSERT_EQ(file.at<double>(56), structures_.field.voxel());
  ASSERT_EQ(file.at<double>(doubles.back()), structures_.info.box_M.max().z());
  for (const std::size_t at : doubles) {
    for (const double bad :
         {std::nan(""), std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()})
      EXPECT_NE(file.with(at, bad), "accepted") << "byte " << at;
    EXPECT_EQ(file.with(at, file.at<double>(at)), "accepted");
  }
  for (const double bad : {0.0, -0.002, 1e300})
    EXPECT_THAT(file.with(56, bad), HasSubstr("not a plausible length")) << "voxel";
  for (const std::int32_t bad : {0, -1, 65, 3}) EXPECT_NE(file.with(108, bad), "accepted") << "refinement";
  for (const std::int32_t bad : {0, -1, 2'000'000, 0x7FFFFFFF})
    EXPECT_NE(file.with(96, bad), "accepted") << "bricks";
}

TEST_F(CraftedStructureFile, DilationsThatNoBakeGivesAreRefused) {
  structures_.field = test::dilated(structures_.field, 0.001);
  (void)written();
  ChangedFile file(this->file());
  const std::size_t corners = file.count(11);
  ASSERT_EQ(corners, structures_.field.layout().dilations.size());
  for (const float bad : {std::nanf(""), -1e-6F, 0.0011F, std::numeric_limits<float>::infinity()})
    EXPECT_THAT(file.with(file.first(11) + 4 * (corners / 2), bad), HasSubstr("a dilation out of range"));
  EXPECT_EQ(file.with(file.first(11) + 4 * (corners / 2), 0.0F), "accepted");
  EXPECT_THAT(file.with(test::kSectionsAt + 8 * (test::kSections + 11), std::uint64_t{corners - 1}),
              HasSubstr("one dilation for each corner"));
  EXPECT_THAT(file.with(80, 0.0021), HasSubstr("a largest dilation")) << "more than a voxel";
  EXPECT_THAT(file.with(88, 0.9), HasSubstr("a slope out of range"));
}

TEST_F(CraftedStructureFile, PlanesOfValleysThatNoBakeGivesAreRefused) {
  BrickValleys valleys;
  valleys.cells[1] = 3;
  valleys.planes.resize(2);
  for (auto& planes : valleys.planes)
    for (const Vector3f& n : {Vector3f(1.0F, 0.0F, 0.0F), Vector3f(0.0F, 1.0F, 0.0F)})
      planes.push_back({n, 0.5F});
  structures_.field = withValleys(structures_.field, {&valleys, 1});
  (void)written();
  ChangedFile file(this->file());
  ASSERT_EQ(file.count(19), 1U);
  ASSERT_EQ(file.count(20), 2U);
  ASSERT_EQ(file.count(21), 2U) << "equal planes are kept once";
  EXPECT_EQ(file.with(file.first(21), 1.0F), "accepted");
  for (const std::int32_t bad : {1, -2, DistanceField::kNoValley})
    EXPECT_THAT(file.with(file.first(18), bad), HasSubstr("valleys")) << "index";
  EXPECT_THAT(file.with(file.first(19), 1U), HasSubstr("valleys out of order")) << "first cell of a brick";
  EXPECT_THAT(file.with(file.first(19) + 8, std::uint64_t{1}), HasSubstr("other cells"))
      << "cells of a brick";
  EXPECT_THAT(file.with(file.first(20) + 4, 4U + 1U), HasSubstr("planes of valleys out of range"));
  for (const float bad : {std::nanf(""), 2.0F, std::numeric_limits<float>::infinity()})
    EXPECT_THAT(file.with(file.first(21), bad), HasSubstr("planes of valleys out of range")) << "normal";
  EXPECT_THAT(file.with(file.first(21) + 12, std::nanf("")), HasSubstr("planes of valleys out of range"));
  EXPECT_THAT(file.with(test::kSectionsAt + 8 * (test::kSections + 18), std::uint64_t{0}),
              HasSubstr("one entry of valleys for each brick"));
}

TEST_F(CraftedStructureFile, WhatCouldNotBeReadIsNotWritten) {
  // a field that refers to one brick more than there are index entries for
  const DistanceField::Layout& layout = structures_.field.layout();
  const std::vector<std::int16_t> more(layout.samples.size() + DistanceField::kBrickSamples);
  DistanceField::Layout damaged = layout;
  damaged.samples = more;
  HapticStructures structures = structures_;
  structures.field = DistanceField(damaged, nullptr);
  auto ok = writeStructures(file(), structures);
  ASSERT_FALSE(ok);
  EXPECT_THAT(ok.error().what, HasSubstr("samples that no brick refers to"));
  // more bricks than a reader takes: the size is refused before any sample is looked at
  damaged.samples = {
      more.data(), std::size_t{DistanceField::kBrickSamples} * (DistanceField::kMaxBricks + std::size_t{1})};
  structures.field = DistanceField(damaged, nullptr);
  ok = writeStructures(file(), structures);
  ASSERT_FALSE(ok);
  EXPECT_THAT(ok.error().what, HasSubstr("more bricks than queries can address (1472896 with samples"));
  EXPECT_FALSE(fs::exists(file()));
}

}  // namespace
}  // namespace tenon::structures
