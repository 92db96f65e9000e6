#include "server/structures/huge_pages.h"

#include <cstdint>
#include <fstream>
#include <numeric>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "server/structures/field_builder.h"

namespace tenon::structures {
namespace {

/// The value of a field of /proc/self/smaps for the mapping that contains `memory`.
std::optional<std::string> smapsField(const void* memory, const std::string& name) {
  std::ifstream in("/proc/self/smaps");
  const auto address = reinterpret_cast<std::uintptr_t>(memory);
  bool inside = false;
  for (std::string line; std::getline(in, line);) {
    std::size_t used = 0;
    const std::size_t dash = line.find('-');
    if (dash != std::string::npos && dash < line.find(' ')) {
      const std::uintptr_t first = std::stoull(line, &used, 16);
      inside = first <= address && address < std::stoull(line.substr(dash + 1), nullptr, 16);
    } else if (inside && line.rfind(name + ":", 0) == 0) {
      return line.substr(name.size() + 1);
    }
  }
  return {};
}

/// Whether this kernel gives huge pages to those who ask.
bool kernelHasHugePages() {
  std::ifstream in("/sys/kernel/mm/transparent_hugepage/enabled");
  std::string modes;
  std::getline(in, modes);
  return !modes.empty() && modes.find("[never]") == std::string::npos;
}

TEST(HugePages, ArraysOfAnySizeHoldWhatIsPutIntoThem) {
  for (const std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{1000}, kHugePageBytes / 4 - 1,
                                  kHugePageBytes / 4, kHugePageBytes / 4 + 1, kHugePageBytes}) {
    HugeVector<std::uint32_t> numbers(count);
    std::iota(numbers.begin(), numbers.end(), 7U);
    numbers.push_back(42);  // into other memory
    numbers.shrink_to_fit();
    for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(numbers[i], 7U + i);
    EXPECT_EQ(numbers.back(), 42U);
  }
}

TEST(HugePages, LargeArraysBeginOnAHugePageAndSmallOnesOnACacheLine) {
  const auto offset = [](const auto& vector, std::size_t unit) {
    return reinterpret_cast<std::uintptr_t>(vector.data()) % unit;
  };
  for (int i = 0; i < 8; ++i) {
    EXPECT_EQ(
        offset(HugeVector<std::int16_t>(kHugePageBytes / 2 + static_cast<std::size_t>(i)), kHugePageBytes),
        0U);
    EXPECT_EQ(offset(HugeVector<char>(static_cast<std::size_t>(1 + 100 * i)), 64), 0U);
  }
}

TEST(HugePages, TheKernelIsAskedForThem) {
  if (!kernelHasHugePages())
    GTEST_SKIP() << "this kernel has no transparent huge pages, or they are switched off";
  const HugeVector<std::int16_t> samples(8 * kHugePageBytes, 1);
  const auto flags = smapsField(samples.data() + kHugePageBytes, "VmFlags");
  ASSERT_TRUE(flags) << "the memory is in no mapping";
  EXPECT_NE(flags->find(" hg"), std::string::npos) << *flags;
}

TEST(HugePages, TheSamplesOfAFieldAreInThem) {
  if (!kernelHasHugePages())
    GTEST_SKIP() << "this kernel has no transparent huge pages, or they are switched off";
  const Vector3 corner = Vector3::Constant(0.05);
  const DistanceField field =
      buildField([](const Vector3& p) { return p.norm() - 0.05; }, {-corner, corner}, 0.0006);
  ASSERT_GT(field.layout().samples.size_bytes(), 2 * kHugePageBytes);
  const auto flags = smapsField(field.layout().samples.data(), "VmFlags");
  ASSERT_TRUE(flags);
  EXPECT_NE(flags->find(" hg"), std::string::npos) << *flags;
}

}  // namespace
}  // namespace tenon::structures
