#include <array>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "server/collision/contact_refinement.h"
#include "server/structures/outer_surface.h"
#include "tests/server/collision/baked_pair.h"
#include "tests/support/shared_files.h"
#include "tests/support/solid_union.h"

namespace tenon {
namespace {

using test::baked;
using test::Chance;
using test::SolidUnion;

/// A body that is asked: its structures, its mesh, and what is true of it.
struct Asked {
  Asked(const PartMesh& part, double voxel)
      : mesh(test::meshOf(part)), structures(baked(mesh, voxel, 4000)), truth(solidsOf(part)) {
    std::vector<SurfaceTree::Triangle> triangles;
    for (const auto& [a, b, c] : mesh.triangles) {
      triangles.push_back({mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]});
    }
    surface = SurfaceTree(outerTriangles(triangles, structures->field));
  }

  static std::vector<SolidUnion::Solid> solidsOf(const PartMesh& part) {
    std::vector<SolidUnion::Solid> solids;
    for (const PartMesh::Shell& shell : part.shells) {
      const auto begin = part.triangles.begin() + static_cast<std::ptrdiff_t>(shell.first);
      solids.push_back({{begin, begin + static_cast<std::ptrdiff_t>(shell.count)}, shell.closed});
    }
    return solids;
  }

  TriangleMesh mesh;
  std::shared_ptr<const HapticStructures> structures;
  SolidUnion truth;
  SurfaceTree surface;
};

/// What the query says against what is true, over poses in contact.
struct Errors {
  std::vector<double> depth;  ///< [m] of points that are inside in truth or by the query
  std::vector<double> force;  ///< share of the net force
  std::size_t touching = 0;   ///< points that are inside in truth
  std::size_t missed = 0;     ///< of these, those that the query does not have inside

  static double at(std::vector<double> values, double share) {
    std::sort(values.begin(), values.end());
    return values.empty() ? 1e9
                          : values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
  }
  [[nodiscard]] double missedShare() const {
    return static_cast<double>(missed) / static_cast<double>(std::max<std::size_t>(touching, 1));
  }
  [[nodiscard]] std::string text() const {
    char line[256];
    std::snprintf(line, sizeof line,
                  "%zu points inside: depth error median %.5f mm, p99 %.4f mm; %.2f %% missed; net force "
                  "error median %.2f %%",
                  touching, 1e3 * at(depth, 0.5), 1e3 * at(depth, 0.99), 100.0 * missedShare(),
                  100.0 * at(force, 0.5));
    return line;
  }
};

/// Adds what is wrong at one pose X_BA.
void compare(const HapticStructures& a, const Asked& b, const Pose& X_BA, const PairQueryResult& result,
             Errors& errors) {
  const auto points = a.shell.points();
  std::vector<double> said(points.size(), 1.0);
  for (const Contact& contact : result.contacts) said[contact.point] = contact.gap;
  Vector3 force = Vector3::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vector3 p_BP = X_BA * points[i].p_MP.cast<double>();
    if (b.structures->field.lowerBound(p_BP) > 0.003) continue;
    const auto nearest = b.truth.nearest(p_BP);
    const bool inside = b.truth.inside(p_BP);
    if (inside) {
      ++errors.touching;
      if (said[i] > 0.0) ++errors.missed;
      force += static_cast<double>(points[i].area) / 1e-4 * (nearest.p_MQ - p_BP);
    }
    if (said[i] > 0.0) continue;
    errors.depth.push_back(std::abs(said[i] - (inside ? -1.0 : 1.0) * nearest.distance));
  }
  if (force.norm() > 0.0) errors.force.push_back((result.push_Ao_W.force - force).norm() / force.norm());
}

/// A pressed into B at `poses` places, along its axes but for `tilt`.
Errors errorsOf(const HapticStructures& a, const Asked& b, int poses, double deepest, double tilt,
                bool refine) {
  Chance chance(43);
  Errors errors;
  const auto result = std::make_unique<PairQueryResult>();
  for (int i = 0; i < poses; ++i) {
    const double depth = deepest * (0.55 + 0.45 * chance.number());
    PairQuery query{&a.shell, &b.structures->field, Pose(), Pose()};
    query.X_WA = test::pressedSomewhere(a, *b.structures, depth, tilt, chance);
    query.sum = true;
    if (refine) query.margin = 0.25 * b.structures->field.voxel();
    queryPair(query, *result);
    if (result->smallest_gap > 0.0 || result->counts.contacts_dropped > 0) continue;
    if (refine) refineContacts(query, b.surface, RefinementBudget(), *result);
    compare(a, b, query.X_WA, *result, errors);
  }
  return errors;
}

void expectTrueWithin(const Errors& errors, double p99) {
  SCOPED_TRACE(errors.text());
  EXPECT_GT(errors.touching, 300U);
  EXPECT_LE(Errors::at(errors.depth, 0.5), 0.01e-3);
  EXPECT_LE(Errors::at(errors.depth, 0.99), p99);
  EXPECT_LE(errors.missedShare(), 0.01);
  EXPECT_LE(Errors::at(errors.force, 0.5), 0.03);
}

void expectFieldIsTrue(const Errors& errors) { expectTrueWithin(errors, 0.5e-3); }
void expectRefinedIsTrue(const Errors& errors) { expectTrueWithin(errors, 0.02e-3); }

constexpr double kFlat = 0.03;  // [rad]
constexpr double kAnyhow = 1.0;

TEST(QueryTruth, ABoxOnItsPegIsAsDeepAsInTheMeshOfThePeg) {
  const Asked peg(test::partNamed("peg", 0.1), 0.001);
  const auto box = baked(test::meshOf(test::partNamed("box_with_hole", 0.1)), 0.003, 4000);
  expectFieldIsTrue(errorsOf(*box, peg, 150, 0.002, kFlat, false));
  expectRefinedIsTrue(errorsOf(*box, peg, 150, 0.002, kFlat, true));
}

TEST(QueryTruth, APegOnItsBoxOfBlocksIsAsDeepAsInTheirMesh) {
  const Asked box(test::partNamed("box_with_hole", 0.1), 0.002);
  const auto peg = baked(test::meshOf(test::partNamed("peg", 0.1)), 0.003, 4000);
  expectRefinedIsTrue(errorsOf(*peg, box, 150, 0.004, kFlat, true));
  expectRefinedIsTrue(errorsOf(*peg, box, 150, 0.004, kAnyhow, true));
}

/// A file's triangles as one solid.
PartMesh solidOf(const TriangleMesh& mesh) {
  PartMesh part;
  for (const auto& [a, b, c] : mesh.triangles) {
    part.triangles.push_back(
        {mesh.vertices[a].cast<double>(), mesh.vertices[b].cast<double>(), mesh.vertices[c].cast<double>()});
  }
  part.shells.push_back({0, part.triangles.size(), true});
  return part;
}

struct RealPair {
  const char* folder;
  const char* fixed;
  const char* moving;
};

class QueryTruthOfRealPairs : public ::testing::TestWithParam<RealPair> {};

TEST_P(QueryTruthOfRealPairs, DepthsAreThoseOfTheMesh) {
  const auto folder = test::sharedFolder() / "cad" / "pairs" / GetParam().folder;
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no folder of CAD pairs (TENON_SHARED)";
  const auto fixed = importMesh(folder / GetParam().fixed, 1.0);
  const auto moving = importMesh(folder / GetParam().moving, 1.0);
  ASSERT_TRUE(fixed) << fixed.error().what;
  ASSERT_TRUE(moving) << moving.error().what;
  const Asked hole(solidOf(*fixed), 0.25e-3);
  const auto peg = baked(*moving, 1e-3, 4000);
  expectFieldIsTrue(errorsOf(*peg, hole, 100, 0.75e-3, kFlat, false));
  expectRefinedIsTrue(errorsOf(*peg, hole, 100, 0.75e-3, kFlat, true));
  expectRefinedIsTrue(errorsOf(*peg, hole, 100, 0.75e-3, kAnyhow, true));
}

INSTANTIATE_TEST_SUITE_P(
    Factory, QueryTruthOfRealPairs,
    ::testing::Values(RealPair{"nv_factory_round_8mm", "factory_round_hole_8mm_subdiv_3x.obj",
                               "factory_round_peg_8mm_loose.obj"},
                      RealPair{"nv_factory_rect_16mm", "factory_rectangular_hole_16mm_subdiv_3x.obj",
                               "factory_rectangular_peg_16mm_loose_subdiv_3x.obj"}),
    [](const auto& instance) { return std::string(instance.param.folder); });

}  // namespace
}  // namespace tenon
