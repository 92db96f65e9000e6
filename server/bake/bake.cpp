#include "server/bake/bake.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <utility>

#include "server/bake/feature_bake.h"
#include "server/bake/field_bake.h"
#include "server/bake/parallel.h"
#include "server/bake/shell_bake.h"
#include "server/bake/thin_places.h"
#include "server/bake/valley_bake.h"
#include "server/bake/welded_mesh.h"
#include "server/structures/gap_note.h"

namespace tenon::bake {

Result<void> checkOptions(const BakeOptions& options) {
  if (!(options.voxel > 0.0) || !std::isfinite(options.voxel))
    return fail("the voxel size must be greater than 0");
  const int r = options.refinement;
  if (r != 1 && r != 2 && r != 4 && r != 8) return fail("the refinement must be 1, 2, 4 or 8");
  if (!std::isfinite(options.point_spacing) || options.point_spacing < 0.0) {
    return fail("the spacing of shell points must be 0 or more");
  }
  constexpr double kMaxPoints = 1e6;
  if (options.points == 0 || options.points > kMaxPoints)
    return fail("the number of shell points must be 1 to 1,000,000");
  for (const RefineBox& region : options.refine) {
    if (!region.box_M.min().allFinite() || !region.box_M.max().allFinite() || region.box_M.isEmpty()) {
      return fail("a box to refine is empty or not finite");
    }
  }
  return {};
}

namespace {

Result<void> checkMesh(const TriangleMesh& mesh) {
  for (const Vector3f& p : mesh.vertices) {
    if (!p.allFinite()) return fail("the mesh has a vertex that is not finite");
  }
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t corner : triangle) {
      if (corner >= mesh.vertices.size())
        return fail("the mesh has a triangle with a vertex index out of range");
    }
  }
  return {};
}

/// A note about connected parts that have no inside in the field: contacts push out of them on both sides.
std::string noteSheets(const WeldedMesh& mesh, const structures::DistanceField& field) {
  const auto [component, count] = mesh.components();
  std::vector<std::uint8_t> has_inside(count, 0);
  std::vector<std::uint32_t> first(count, 0);
  for (std::size_t i = mesh.triangles.size(); i-- > 0;) {
    first[component[i]] = static_cast<std::uint32_t>(i);
    if (has_inside[component[i]] != 0) continue;
    const structures::Triangle& t = mesh.triangles[i];
    const Vector3 centre = (t[0] + t[1] + t[2]) / 3.0;
    const double half_voxel = field.voxelAt(centre) / 2;
    const Vector3 step = (t[1] - t[0]).cross(t[2] - t[0]).normalized() * half_voxel;
    const double noise = -0.05 * half_voxel;
    if (field.sample(centre + step).distance < noise || field.sample(centre - step).distance < noise) {
      has_inside[component[i]] = 1;
    }
  }
  std::uint32_t sheets = 0;
  std::uint32_t example = 0;
  for (std::uint32_t c = count; c-- > 0;) {
    if (has_inside[c] != 0) continue;
    ++sheets;
    example = first[c];
  }
  if (sheets == 0) return {};
  const Vector3 at = mesh.triangles[example][0];
  char text[256];
  std::snprintf(text, sizeof text,
                "%u of %u connected parts have no inside (open, or thinner than a voxel), the first at "
                "(%.4g, %.4g, %.4g) m: they are treated as thin sheets.\n",
                sheets, count, at.x(), at.y(), at.z());
  return text;
}

/// A note about slots and fins narrower than two voxels, where no box asked for refinement.
std::string noteGaps(const BakedField& baked) {
  if (baked.refined_gaps.empty() && baked.coarse_gaps.empty()) return {};
  std::string note = std::string(structures::kGapNote) + std::to_string(baked.refined_gaps.size()) +
                     " places with gaps below two voxels are refined, ";
  if (baked.coarse_gaps.empty()) return note + "all that there are\n";
  const AirGap& first = baked.coarse_gaps.front();
  char text[256];
  std::snprintf(text, sizeof text, "%zu are not resolved, the narrowest %.3g mm at (%.4g, %.4g, %.4g) m\n",
                baked.coarse_gaps.size(), 1e3 * first.width, first.p_MP.x(), first.p_MP.y(), first.p_MP.z());
  return note + text;
}

}  // namespace

Result<structures::HapticStructures> bake(const TriangleMesh& mesh, const BakeOptions& options,
                                          const BakeProgress& progress) {
  const auto start = std::chrono::steady_clock::now();
  if (const auto ok = checkOptions(options); !ok) return tl::unexpected(ok.error());
  if (const auto ok = checkMesh(mesh); !ok) return tl::unexpected(ok.error());

  ParallelWork work(progress);
  work.stage("welding", 0.0, 0.05);
  const WeldedMesh welded(mesh);
  if (welded.triangles.empty()) return fail("the mesh has no triangle with an area");
  auto baked = bakeField(welded, options, work);
  if (!baked) return tl::unexpected(baked.error());

  structures::HapticStructures structures;
  structures::StructureInfo& info = structures.info;
  const structures::DistanceField undilated = structures::viewOf(baked->storage);
  work.stage("sampling the shell", 0.88, 0.95);
  structures.shell = bakeShell(welded, baked->surface, undilated, options, work);
  if (work.cancelled()) return fail("cancelled");
  if (!structures.shell.empty()) {
    structures.features = bakeFeatures(welded, *baked->surface_tree, undilated,
                                       static_cast<double>(structures.shell.levels().back().spacing));
  }
  const std::string sheets = noteSheets(welded, undilated);
  work.stage("thickening thin walls", 0.95, 0.99);
  const ThinPlaces thin = findThinPlaces(undilated, baked->surface, baked->thin, work);
  if (work.cancelled()) return fail("cancelled");
  structures.field = structures::makeDilatedField(std::move(baked->storage), thin.dilations);
  const auto valleys = findValleys(structures.field, *baked->surface_tree,
                                   baked->mesh_tree ? &*baked->mesh_tree : nullptr, work);
  if (work.cancelled()) return fail("cancelled");
  structures.field = structures::withValleys(structures.field, valleys);
  info.thin_area = thin.area;
  info.open_area = thin.open_area;
  info.filled = std::move(baked->filled);

  info.triangles = mesh.triangles.size();
  for (const structures::Triangle& t : welded.triangles) info.box_M.extend(structures::boxOf(t));
  for (const structures::Triangle& t : baked->surface) info.surface_area += structures::areaOf(t);
  info.bricks = structures.field.layout().samples.size() / structures::DistanceField::kBrickSamples;
  for (const std::string& note : mesh.notes) info.notes += note + "\n";
  if (welded.skipped > 0) {
    info.notes += std::to_string(welded.skipped) + " triangles without area or present twice were skipped.\n";
  }
  if (welded.joined + welded.split > 0) {
    info.notes += std::to_string(welded.joined + welded.split) +
                  " vertices and edges of open borders were stitched to others at the same place.\n";
  }
  if (welded.closed > 0) {
    info.notes += std::to_string(welded.closed) + " holes of one missing triangle were closed.\n";
  }
  if (baked->hidden_triangles > 0) {
    info.notes += std::to_string(baked->hidden_triangles) +
                  " triangles lie inside the solid and are not part of its surface.\n";
  }
  info.notes += noteGaps(*baked);
  info.notes += sheets;
  info.bake_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  work.stage("done", 1.0, 1.0);
  return structures;
}

}  // namespace tenon::bake
