#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "scenarios/scenario_parts.h"
#include "server/bake/bake.h"
#include "server/collision/pair_query.h"

namespace tenon::test {

/// A part that the project draws itself, coarsely.
inline PartMesh partNamed(std::string_view name, double detail) {
  for (const PartSet& set : {pegAndBoxParts(), engineBayParts()}) {
    for (const ScenarioPart& part : set.parts) {
      if (part.name == name) return part.make(detail);
    }
  }
  ADD_FAILURE() << "no part " << name;
  return {};
}

/// As a file would have it: no shells, no shared corners.
inline TriangleMesh meshOf(const PartMesh& part) {
  TriangleMesh mesh;
  for (const auto& triangle : part.triangles) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (const Vector3& corner : triangle) mesh.vertices.push_back(corner.cast<float>());
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

inline std::shared_ptr<const HapticStructures> baked(const TriangleMesh& mesh, double voxel,
                                                     std::uint32_t points,
                                                     std::vector<RefineBox> refine = {}) {
  BakeOptions options;
  options.voxel = voxel;
  options.points = points;
  options.refine = std::move(refine);
  auto structures = bake(mesh, options);
  EXPECT_TRUE(structures) << (structures ? "" : structures.error().what);
  return std::make_shared<const HapticStructures>(structures ? std::move(*structures) : HapticStructures());
}

/// Numbers that are the same on every machine.
class Chance {
 public:
  explicit Chance(std::uint64_t seed) : engine_(seed) {}

  /// -1 to 1.
  double number() { return 2.0 * (static_cast<double>(engine_() >> 11U) / 9007199254740992.0) - 1.0; }
  Vector3 vector() {
    const double x = number();
    const double y = number();
    return {x, y, number()};
  }
  std::size_t index(std::size_t size) { return engine_() % size; }

 private:
  std::mt19937_64 engine_;
};

/// A moved towards a place on B from outside until it is `depth` deep (negative: until it is that near). It
/// stands along the axes of B in one of 24 ways, tilted by up to `tilt` [rad] about each.
inline Pose pressedSomewhere(const HapticStructures& a, const HapticStructures& b, double depth, double tilt,
                             Chance& chance) {
  const ShellPoint& place = b.shell.points()[chance.index(b.shell.points().size())];
  const Vector3 in_B = place.inward_M.cast<double>();
  const double start = 2.0 * (a.shell.radius() + b.shell.radius());
  Quaternion q_BA = expRotation(tilt * chance.vector());
  const double quarter = std::numbers::pi / 2.0;
  q_BA = expRotation(quarter * static_cast<double>(chance.index(4)) * Vector3::UnitX()) * q_BA;
  q_BA = expRotation(quarter * static_cast<double>(chance.index(4)) * Vector3::UnitY()) * q_BA;
  q_BA = expRotation(quarter * static_cast<double>(chance.index(4)) * Vector3::UnitZ()) * q_BA;
  const ShellPoint& first = a.shell.points()[chance.index(a.shell.points().size())];
  Pose X_BA(place.p_MP.cast<double>() - q_BA * first.p_MP.cast<double>() - start * in_B, q_BA);
  const auto result = std::make_unique<PairQueryResult>();
  for (double way = 0.0; way < start + 0.01;) {
    queryPair({&a.shell, &b.field, X_BA, Pose()}, *result);
    const double missing = depth + result->smallest_gap;
    if (missing <= 0.0) break;
    const double step = std::max(missing, 1e-5);
    X_BA.translation() += step * in_B;
    way += step;
  }
  return X_BA;
}

}  // namespace tenon::test
