#include <array>
#include <filesystem>
#include <ostream>
#include <string>

#include <gtest/gtest.h>

#include "server/collision/contact_refinement.h"
#include "server/structures/outer_surface.h"
#include "tests/server/collision/baked_pair.h"
#include "tests/support/contact_errors.h"
#include "tests/support/shared_files.h"
#include "tests/support/solid_union.h"

namespace tenon::collision {
namespace {

using test::baked;
using test::ContactErrors;
using test::SeededRandom;
using test::SolidUnion;

/// Body B of a query: its structures, its mesh, and the reference distances of its solids.
struct FieldSide {
  FieldSide(const part_generator::PartMesh& part, double voxel)
      : mesh(test::meshOf(part)), structures(test::baked(mesh, voxel, 4000)), truth(solidsOf(part)) {
    std::vector<structures::SurfaceTree::Triangle> triangles;
    for (const auto& [a, b, c] : mesh.triangles) {
      triangles.push_back({mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]});
    }
    surface = structures::SurfaceTree(structures::outerTriangles(triangles, structures->field));
  }

  static std::vector<test::SolidUnion::Solid> solidsOf(const part_generator::PartMesh& part) {
    std::vector<test::SolidUnion::Solid> solids;
    for (const part_generator::PartMesh::Shell& shell : part.shells) {
      const auto begin = part.triangles.begin() + static_cast<std::ptrdiff_t>(shell.first);
      solids.push_back({{begin, begin + static_cast<std::ptrdiff_t>(shell.count)}, shell.closed});
    }
    return solids;
  }

  bake::TriangleMesh mesh;
  std::shared_ptr<const structures::HapticStructures> structures;
  test::SolidUnion truth;
  structures::SurfaceTree surface;
};

/// Errors of queries of A against B at `poses` random poses, up to `deepest` [m] deep, tilted by up to `tilt`
/// [rad].
test::ContactErrors errorsOf(const structures::HapticStructures& a, const FieldSide& b, int poses,
                             double deepest, double tilt, bool refine) {
  test::SeededRandom random(43);
  test::ContactErrors errors;
  const auto result = std::make_unique<PairQueryResult>();
  for (int i = 0; i < poses; ++i) {
    const double depth = deepest * (0.55 + 0.45 * random.symmetric());
    PairQuery query{&a.shell, &b.structures->field, Pose(), Pose()};
    query.X_WA = test::randomContactPose(a, *b.structures, depth, tilt, random);
    query.sum_penalty = true;
    query.correct_ridges = true;
    if (refine) query.margin = 0.25 * b.structures->field.voxel();
    queryPair(query, *result);
    if (result->smallest_gap > 0.0 || result->counts.contacts_dropped > 0) continue;
    if (refine) refineContacts(query, b.surface, RefinementBudget(), *result);
    errors.add(query, *result, b.truth);
  }
  return errors;
}

/// `p99` [m]: limit of the depth error's 99th percentile.
void expectAccurate(const test::ContactErrors& errors, double p99) {
  SCOPED_TRACE(errors.text());
  EXPECT_GT(errors.pointsInside(), 300U);
  EXPECT_LE(errors.depth(0.5), 0.01e-3);
  EXPECT_LE(errors.depth(0.99), p99);
  EXPECT_LE(errors.missed(), 0.01);
  EXPECT_LE(errors.force(0.5), 0.03);
}

void expectFieldAccurate(const test::ContactErrors& errors) { expectAccurate(errors, 0.5e-3); }
void expectRefinedAccurate(const test::ContactErrors& errors) { expectAccurate(errors, 0.02e-3); }

constexpr double kSmallTilt = 0.03;  // [rad]
constexpr double kLargeTilt = 1.0;   // [rad]

TEST(QueryTruth, DepthsOfABoxOnAPegAreThoseOfThePegsMesh) {
  const FieldSide peg(test::partNamed("peg", 0.1), 0.001);
  const auto box = test::baked(test::meshOf(test::partNamed("box_with_hole", 0.1)), 0.003, 4000);
  expectFieldAccurate(errorsOf(*box, peg, 150, 0.002, kSmallTilt, false));
  expectRefinedAccurate(errorsOf(*box, peg, 150, 0.002, kSmallTilt, true));
}

TEST(QueryTruth, RefinedDepthsOfAPegOnABoxOfBlocksAreThoseOfTheirMesh) {
  const FieldSide box(test::partNamed("box_with_hole", 0.1), 0.002);
  const auto peg = test::baked(test::meshOf(test::partNamed("peg", 0.1)), 0.003, 4000);
  expectRefinedAccurate(errorsOf(*peg, box, 150, 0.004, kSmallTilt, true));
  expectRefinedAccurate(errorsOf(*peg, box, 150, 0.004, kLargeTilt, true));
}

/// The triangles of a mesh as one closed solid.
part_generator::PartMesh solidOf(const bake::TriangleMesh& mesh) {
  part_generator::PartMesh part;
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
void PrintTo(const RealPair& pair, std::ostream* out) { *out << pair.folder; }

class QueryTruthOfRealPairs : public ::testing::TestWithParam<RealPair> {};

TEST_P(QueryTruthOfRealPairs, DepthsAreThoseOfTheMesh) {
  const auto folder = test::dataFolder() / "pairs" / GetParam().folder;
  const auto fixed = bake::importMesh(folder / GetParam().fixed, 1.0);
  const auto moving = bake::importMesh(folder / GetParam().moving, 1.0);
  ASSERT_TRUE(fixed) << fixed.error().what;
  ASSERT_TRUE(moving) << moving.error().what;
  const FieldSide hole(solidOf(*fixed), 0.25e-3);
  const auto peg = test::baked(*moving, 1e-3, 4000);
  expectFieldAccurate(errorsOf(*peg, hole, 100, 0.75e-3, kSmallTilt, false));
  expectRefinedAccurate(errorsOf(*peg, hole, 100, 0.75e-3, kSmallTilt, true));
  expectRefinedAccurate(errorsOf(*peg, hole, 100, 0.75e-3, kLargeTilt, true));
}

INSTANTIATE_TEST_SUITE_P(
    Factory, QueryTruthOfRealPairs,
    ::testing::Values(RealPair{"nv_factory_round_8mm", "factory_round_hole_8mm_subdiv_3x.obj",
                               "factory_round_peg_8mm_loose.obj"},
                      RealPair{"nv_factory_rect_16mm", "factory_rectangular_hole_16mm_subdiv_3x.obj",
                               "factory_rectangular_peg_16mm_loose_subdiv_3x.obj"}),
    [](const auto& instance) { return std::string(instance.param.folder); });

}  // namespace
}  // namespace tenon::collision
