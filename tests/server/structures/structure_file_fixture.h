#pragma once

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <unistd.h>

#include "server/structures/field_builder.h"
#include "server/structures/haptic_structures.h"
#include "server/structures/shell_builder.h"

namespace tenon::structures {

/// Each test has its own folder, removed afterwards.
class StructureFile : public ::testing::Test {
 protected:
  StructureFile() {
    std::filesystem::create_directories(folder_);
    const Vector3 corner = Vector3::Constant(0.02);
    const std::array refine{Eigen::AlignedBox3d(Vector3::Zero(), corner)};
    structures_.field =
        buildField([](const Vector3& p) { return p.norm() - 0.02; }, {-corner, corner}, 0.002, refine, 2);
    std::vector<SurfaceSample> samples;
    for (int i = 0; i < 100; ++i) samples.push_back({Vector3(0.001 * i, 0.0, 0.02), -Vector3::UnitZ(), 1e-6});
    structures_.shell = buildShell(samples);
    FeatureStorage features;
    std::vector<std::uint32_t> order;
    features.points = buildFlatShell(samples, 0.001, order);
    features.edges.resize(order.size(), {{0.0005F, 0.0F, 0.0F}, {-Vector3f::UnitY(), Vector3f::UnitY()}});
    structures_.features = makeFeatureShell(std::move(features));
    structures_.info.source = "ball.stl";
    structures_.info.content_hash = "0123";
    structures_.info.meshes = {folder_.parent_path() / "parts" / "ball.stl"};
    structures_.info.unit = 0.0254;
    structures_.info.notes = "A note.\n";
    structures_.info.triangles = 12;
    structures_.info.box_M = {-corner, corner};
  }
  ~StructureFile() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::string written() {
    const auto ok = writeStructures(file(), structures_);
    EXPECT_TRUE(ok);
    std::ifstream in(file(), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void overwrite(const std::string& bytes) const {
    std::ofstream(file(), std::ios::binary | std::ios::trunc) << bytes;
  }
  [[nodiscard]] std::filesystem::path file() const { return folder_ / "ball.tenon"; }

  std::filesystem::path folder_ = std::filesystem::temp_directory_path() /
                                  ("tenon-structure-file-" + std::to_string(::getpid()) +
                                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
  HapticStructures structures_;
};

/// Reads everything that a field and a shell can be asked for; returns how much that was.
inline std::size_t useEverything(const HapticStructures& structures) {
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
  for (const FeatureEdge& edge : structures.features.edges()) used += edge.half_M.isZero() ? 0 : 1;
  EXPECT_EQ(structures.features.edges().size(), structures.features.points().points().size());
  return used;
}

}  // namespace tenon::structures
