#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "scenarios/part_generator/scenario_parts.h"
#include "server/bake/bake.h"
#include "server/collision/pair_query.h"
#include "tests/support/test_meshes.h"

namespace tenon::test {

/// A generated part of the project's scenarios; `detail` [-] as in ScenarioPart::make, 1 is the finest.
inline part_generator::PartMesh partNamed(std::string_view name, double detail) {
  for (const part_generator::PartSet& set :
       {part_generator::pegAndBoxParts(), part_generator::engineBayParts()}) {
    for (const part_generator::ScenarioPart& part : set.parts) {
      if (part.name == name) return part.make(detail);
    }
  }
  ADD_FAILURE() << "no part " << name;
  return {};
}

/// The triangles of a part as an STL file has them: without shells and shared vertices.
inline bake::TriangleMesh meshOf(const part_generator::PartMesh& part) {
  bake::TriangleMesh mesh;
  for (const auto& triangle : part.triangles) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (const Vector3& corner : triangle) mesh.vertices.push_back(corner.cast<float>());
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// Bakes a mesh with `voxel` [m]; adds a test failure and returns empty structures when that fails.
inline std::shared_ptr<const structures::HapticStructures> baked(const bake::TriangleMesh& mesh, double voxel,
                                                                 std::uint32_t points,
                                                                 std::vector<bake::RefineBox> refine = {}) {
  bake::BakeOptions options;
  options.voxel = voxel;
  options.points = points;
  options.refine = std::move(refine);
  auto structures = bake::bake(mesh, options);
  EXPECT_TRUE(structures) << (structures ? "" : structures.error().what);
  return std::make_shared<const structures::HapticStructures>(structures ? std::move(*structures)
                                                                         : structures::HapticStructures());
}

inline constexpr double kBarEdge = 0.0070710678118654752;  ///< [m] of a barShape, from its axis

/// A bar of 60 mm along `along`, 10 mm square, turned by 45 deg about it: an edge is up and one down.
inline std::shared_ptr<const structures::HapticStructures> barShape(const Vector3& along) {
  const Vector3 half = Vector3::Constant(0.005) + 0.025 * along;
  bake::TriangleMesh mesh = boxMesh(-half, half);
  const Quaternion q = expRotation(along * (std::numbers::pi / 4.0));
  for (Vector3f& p : mesh.vertices) p = (q * p.cast<double>()).cast<float>();
  return baked(mesh, 0.001, 2000);
}

/// Pseudo-random numbers that are the same on every machine.
class SeededRandom {
 public:
  explicit SeededRandom(std::uint64_t seed) : engine_(seed) {}

  /// [-] Uniform in [-1, 1).
  double symmetric() { return 2.0 * (static_cast<double>(engine_() >> 11U) / 9007199254740992.0) - 1.0; }
  /// Each coordinate uniform in [-1, 1).
  Vector3 vector() {
    const double x = symmetric();
    const double y = symmetric();
    return {x, y, symmetric()};
  }
  /// 0 to size - 1.
  std::size_t index(std::size_t size) { return engine_() % size; }

 private:
  std::mt19937_64 engine_;
};

/// Pose X_BA of A moved from outside towards a random point of B's surface until it is `depth` [m] deep
/// (negative: until the gap is that small). A's axes are those of B in one of 24 orientations, tilted by up
/// to `tilt` [rad] about each.
inline Pose randomContactPose(const structures::HapticStructures& a, const structures::HapticStructures& b,
                              double depth, double tilt, SeededRandom& random) {
  const structures::ShellPoint& target = b.shell.points()[random.index(b.shell.points().size())];
  const Vector3 in_B = target.inward_M.cast<double>();
  const double start = 2.0 * (a.shell.radius() + b.shell.radius());
  Quaternion q_BA = expRotation(tilt * random.vector());
  const double quarter = std::numbers::pi / 2.0;
  q_BA = expRotation(quarter * static_cast<double>(random.index(4)) * Vector3::UnitX()) * q_BA;
  q_BA = expRotation(quarter * static_cast<double>(random.index(4)) * Vector3::UnitY()) * q_BA;
  q_BA = expRotation(quarter * static_cast<double>(random.index(4)) * Vector3::UnitZ()) * q_BA;
  const structures::ShellPoint& first = a.shell.points()[random.index(a.shell.points().size())];
  Pose X_BA(target.p_MP.cast<double>() - q_BA * first.p_MP.cast<double>() - start * in_B, q_BA);
  const auto result = std::make_unique<collision::PairQueryResult>();
  for (double travelled = 0.0; travelled < start + 0.01;) {
    collision::queryPair({&a.shell, &b.field, X_BA, Pose()}, *result);
    const double remaining = depth + result->smallest_gap;
    if (remaining <= 0.0) break;
    const double step = std::max(remaining, 1e-5);
    X_BA.translation() += step * in_B;
    travelled += step;
  }
  return X_BA;
}

}  // namespace tenon::test
