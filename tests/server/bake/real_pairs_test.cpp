#include <algorithm>
#include <cmath>
#include <ostream>

#include <gtest/gtest.h>

#include "server/bake/bake.h"
#include "tests/support/exact_distance.h"
#include "tests/support/shared_files.h"

namespace tenon::bake {
namespace {

struct CadPair {
  const char* name;
  const char* fixed;
  const char* moving;
  double lift;  ///< [m] along z, from the pose in the files to one without overlap
};

void PrintTo(const CadPair& pair, std::ostream* out) { *out << pair.name; }

class RealPairs : public ::testing::TestWithParam<CadPair> {};

// The field of the fixed part at the shell points of the assembled moving part, compared with the exact mesh
// distance.
TEST_P(RealPairs, FieldAgreesWithTheMeshAtThePointsOfTheAssembledPart) {
  const auto folder = test::dataFolder() / "pairs" / GetParam().name;
  const auto fixed = importMesh(folder / GetParam().fixed, 1.0);
  const auto moving = importMesh(folder / GetParam().moving, 1.0);
  ASSERT_TRUE(fixed) << fixed.error().what;
  ASSERT_TRUE(moving) << moving.error().what;
  BakeOptions options;
  options.voxel = 0.25e-3;
  options.points = 4000;
  const auto field = bake(*fixed, options);
  options.voxel = 1e-3;
  const auto shell = bake(*moving, options);
  ASSERT_TRUE(field) << field.error().what;
  ASSERT_TRUE(shell) << shell.error().what;

  const test::ExactDistance truth(fixed->vertices, fixed->triangles);
  std::vector<double> errors;
  for (const structures::ShellPoint& point : shell->shell.points()) {
    const Vector3 p = point.p_MP.cast<double>() + Vector3(0.0, 0.0, GetParam().lift);
    const structures::FieldSample sample = field->field.sample(p);
    EXPECT_LE(field->field.lowerBound(p), truth.nearest(p).distance + 1e-9);
    if (sample.exact) errors.push_back(std::abs(std::abs(sample.distance) - truth.nearest(p).distance));
  }
  ASSERT_GT(errors.size(), 200U);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.01e-3);
  EXPECT_LT(errors[errors.size() * 99 / 100], 0.1e-3);
}

INSTANTIATE_TEST_SUITE_P(
    Factory, RealPairs,
    ::testing::Values(CadPair{"nv_factory_round_8mm", "factory_round_hole_8mm_subdiv_3x.obj",
                              "factory_round_peg_8mm_loose.obj", 0.0},
                      CadPair{"nv_factory_rect_16mm", "factory_rectangular_hole_16mm_subdiv_3x.obj",
                              "factory_rectangular_peg_16mm_loose_subdiv_3x.obj", 0.0},
                      CadPair{"nv_factory_nut_bolt_m16", "factory_bolt_m16_loose.ply",
                              "factory_nut_m16_loose_subdiv_3x.ply", 0.002}),
    [](const auto& test_info) { return std::string(test_info.param.name); });

}  // namespace
}  // namespace tenon::bake
