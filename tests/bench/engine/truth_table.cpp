#include "tests/bench/engine/truth_table.h"

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "scenarios/part_generator/scenario_parts.h"
#include "server/collision/contact_refinement.h"
#include "server/collision/pair_query.h"
#include "server/structures/outer_surface.h"
#include "tests/bench/engine/timing.h"
#include "tests/support/contact_errors.h"

namespace tenon::bench {

namespace {

struct QueryVariant {
  const char* name;
  bool correct_ridges, refined;
};
constexpr QueryVariant kQueryVariants[] = {{"field, interpolated", false, false},
                                           {"field, ridge correction", true, false},
                                           {"field, refined by mesh", true, true}};

constexpr double kMargin = 0.02;     // [m] larger than any depth
constexpr std::size_t kPoses = 170;  // of those in contact, evenly distributed

Eigen::AlignedBox3d sweptBox(const structures::Pointshell& shell_A, const std::vector<Pose>& poses) {
  Eigen::AlignedBox3d box_A;
  for (const structures::ShellPoint& point : shell_A.points()) box_A.extend(point.p_MP.cast<double>());
  Eigen::AlignedBox3d swept_B;
  for (const Pose& X_BA : poses) {
    for (int corner = 0; corner < 8; ++corner) {
      swept_B.extend(X_BA * box_A.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
    }
  }
  const Vector3 margin = Vector3::Constant(kMargin);
  return {swept_B.min() - margin, swept_B.max() + margin};
}

/// The solids of a part that intersect a box; others are not nearest to any point of interest.
test::SolidUnion solidsIn(const part_generator::PartMesh& part, const Eigen::AlignedBox3d& box) {
  std::vector<test::SolidUnion::Solid> solids;
  for (const part_generator::PartMesh::Shell& shell : part.shells) {
    const auto begin = part.triangles.begin() + static_cast<std::ptrdiff_t>(shell.first);
    test::SolidUnion::Solid solid{{begin, begin + static_cast<std::ptrdiff_t>(shell.count)}, shell.closed};
    Eigen::AlignedBox3d own;
    for (const auto& triangle : solid.triangles) {
      for (const Vector3& corner : triangle) own.extend(corner);
    }
    if (own.intersects(box)) solids.push_back(std::move(solid));
  }
  return test::SolidUnion(std::move(solids));
}

std::vector<structures::SurfaceTree::Triangle> trianglesIn(const bake::TriangleMesh& mesh,
                                                           const Eigen::AlignedBox3d& box) {
  std::vector<structures::SurfaceTree::Triangle> triangles;
  for (const auto& [a, b, c] : mesh.triangles) {
    const structures::SurfaceTree::Triangle corners{mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]};
    Eigen::AlignedBox3d own;
    for (const Vector3f& corner : corners) own.extend(corner.cast<double>());
    if (own.intersects(box)) triangles.push_back(corners);
  }
  return triangles;
}

}  // namespace

Result<Table> truthTable(const BenchScene& scene, double detail, int rounds,
                         const ProgressCallback& progress) {
  const part_generator::PartSet set = part_generator::engineBayParts();
  const auto bay =
      std::find_if(set.parts.begin(), set.parts.end(),
                   [](const part_generator::ScenarioPart& part) { return part.name == "engine_bay"; });
  if (bay == set.parts.end()) return fail("the engine bay has no part of that name");
  std::vector<Pose> poses;
  const std::size_t stride = std::max<std::size_t>(1, scene.poses.contact.size() / kPoses);
  for (std::size_t i = 0; i < scene.poses.contact.size(); i += stride)
    poses.push_back(scene.poses.contact[i]);
  const Eigen::AlignedBox3d box = sweptBox(scene.box->shell, poses);
  progress("solids around the control box");
  const test::SolidUnion truth = solidsIn(bay->make(detail), box);
  const structures::SurfaceTree surface(
      structures::outerTriangles(trianglesIn(scene.bay_mesh, box), scene.bay->field));

  Table table{"truth",
              "Errors of depths and forces with respect to the mesh (item 4: depth median 0.01 and p99 0.5 "
              "mm, refined 0.02 mm; missed 1 %; force 3 %)",
              {"method", "poses", "points inside", "depth error mm", "p99 mm", "missed %", "force error %",
               "p90 %", "median us", "p99 us"},
              {},
              {"the control box in the engine bay, 0.5 to 5 mm deep; reference: nearest point on the union "
               "of the bay's solids",
               "medians unless stated otherwise; missed: points inside that the query reports outside; force "
               "error: of the net force, relative to it"}};
  const auto result = std::make_unique<collision::PairQueryResult>();
  for (const auto& [name, correct_ridges, refined] : kQueryVariants) {
    progress(fmt::format("errors of: {}", name));
    collision::PairQuery query{&scene.box->shell, &scene.bay->field, Pose(), Pose()};
    query.sum_penalty = true;
    query.correct_ridges = correct_ridges;
    if (refined) query.margin = 0.25 * scene.bay->field.voxel();
    const auto runQuery = [&](std::size_t i) {
      query.X_WA = poses[i];
      collision::queryPair(query, *result);
      if (refined) collision::refineContacts(query, surface, collision::RefinementBudget(), *result);
    };
    const Percentiles times = timed(poses.size(), rounds, runQuery);
    test::ContactErrors errors;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      runQuery(i);
      errors.add(query, *result, truth);
    }
    table.rows.push_back({name, static_cast<double>(errors.poses()),
                          static_cast<double>(errors.pointsInside()), 1e3 * errors.depth(0.5),
                          1e3 * errors.depth(0.99), 100.0 * errors.missed(), 100.0 * errors.force(0.5),
                          100.0 * errors.force(0.9), times.median, times.p99});
  }
  return table;
}

}  // namespace tenon::bench
