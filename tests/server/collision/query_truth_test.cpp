#include <array>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "server/collision/contact_refinement.h"
#include "server/structures/outer_surface.h"
#include "tests/server/collision/baked_pair.h"
#include "tests/support/contact_errors.h"
#include "tests/support/shared_files.h"
#include "tests/support/solid_union.h"

namespace tenon {
namespace {

using test::baked;
using test::Chance;
using test::ContactErrors;
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

/// A pressed into B at `poses` places, along its axes but for `tilt`.
ContactErrors errorsOf(const HapticStructures& a, const Asked& b, int poses, double deepest, double tilt,
                       bool refine) {
  Chance chance(43);
  ContactErrors errors;
  const auto result = std::make_unique<PairQueryResult>();
  for (int i = 0; i < poses; ++i) {
    const double depth = deepest * (0.55 + 0.45 * chance.number());
    PairQuery query{&a.shell, &b.structures->field, Pose(), Pose()};
    query.X_WA = test::pressedSomewhere(a, *b.structures, depth, tilt, chance);
    query.sum = true;
    query.straighten = true;
    if (refine) query.margin = 0.25 * b.structures->field.voxel();
    queryPair(query, *result);
    if (result->smallest_gap > 0.0 || result->counts.contacts_dropped > 0) continue;
    if (refine) refineContacts(query, b.surface, RefinementBudget(), *result);
    errors.add(query, *result, b.truth);
  }
  return errors;
}

void expectTrueWithin(const ContactErrors& errors, double p99) {
  SCOPED_TRACE(errors.text());
  EXPECT_GT(errors.touching(), 300U);
  EXPECT_LE(errors.depth(0.5), 0.01e-3);
  EXPECT_LE(errors.depth(0.99), p99);
  EXPECT_LE(errors.missed(), 0.01);
  EXPECT_LE(errors.force(0.5), 0.03);
}

void expectFieldIsTrue(const ContactErrors& errors) { expectTrueWithin(errors, 0.5e-3); }
void expectRefinedIsTrue(const ContactErrors& errors) { expectTrueWithin(errors, 0.02e-3); }

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
