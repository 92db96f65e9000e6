#include "server/bake/field_bake.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "server/bake/air_gaps.h"
#include "server/bake/brick_level.h"
#include "server/bake/exposed_surface.h"
#include "server/bake/filled_spaces.h"
#include "server/bake/outside.h"
#include "server/bake/parallel.h"
#include "server/bake/point_block.h"
#include "server/bake/refined_bricks.h"
#include "server/bake/slope_limit.h"
#include "server/bake/thin_bricks.h"
#include "server/bake/triangle_tree.h"
#include "server/structures/field_builder.h"
#include "server/structures/structure_checks.h"

namespace tenon::bake {

namespace {

using Cell = BrickLevel::Cell;
using Entry = structures::DistanceField::Entry;
constexpr int kCentreSample = (4 * BrickLevel::kSide + 4) * BrickLevel::kSide + 4;

/// Resamples inside samples as distances to the exposed surface only, and sets signs. `hidden` are the
/// triangles that are not exposed, or not entirely: only a sample with one of them at its distance changes.
void finishSamples(BrickLevel& level, const TriangleTree& exposed, const TriangleTree& hidden,
                   ParallelWork& work) {
  const auto forEachBrick = [&](auto&& act) {
    work.run(level.nodes(), 64, [&](std::size_t node) {
      if (level.slot[node] >= 0) act(node, ~level.outside[static_cast<std::size_t>(level.slot[node])]);
    });
  };
  forEachBrick([&](std::size_t node, const BrickLevel::SampleBits& inside) {
    if (inside.none()) return;
    const std::int16_t* samples = level.samplesOf(level.slot[node]);
    int deepest = 0;
    for (int k = 0; k < BrickLevel::kSamples; ++k)
      if (inside[static_cast<std::size_t>(k)]) deepest = std::max<int>(deepest, samples[k]);
    const double around =
        BrickLevel::kBrickRadius + 0.01 + deepest / double{structures::DistanceField::kQuantaPerVoxel};
    if (!hidden.anyWithin(level.centreOf(node), around * level.voxel)) return;
    const Cell corner = level.brickOf(node) * BrickLevel::kVoxels;
    TriangleTree::Search search(hidden, level.centreOf(node), BrickLevel::kBrickRadius * level.voxel,
                                (level.clampOf(node) + 0.01) * level.voxel);
    BrickLevel::SampleBits stale = inside & level.ownSamples(node);
    PointBlock block;
    std::array<std::size_t, PointBlock::kMost> numbers;
    level.forEachBlock([&](const Cell& from, const Cell& to) {
      // [m] of the stored distances, one quantum larger because of rounding
      const auto reachOf = [&](std::size_t k) {
        return (samples[k] + 1) * level.voxel / structures::DistanceField::kQuantaPerVoxel;
      };
      double farthest = 0.0;
      block.clear();
      BrickLevel::forEachSample(from, to, [&](int sample, const Cell& in_brick) {
        const auto k = static_cast<std::size_t>(sample);
        if (!stale[k]) return;
        const double reach = reachOf(k);
        farthest = std::max(farthest, reach);
        numbers[block.size()] = k;
        block.add(level.position(corner + in_brick), reach * reach);
      });
      if (block.size() == 0) return;
      const bool near =
          search.focus(level.middleOf(corner + from, corner + to), level.radiusOf(from, to), farthest);
      if (near) {
        block.finish();
        search.lower(block);
      }
      for (std::size_t i = 0; i < block.size(); ++i) {
        const double reach = reachOf(numbers[i]);
        if (!near || block.squared(i) >= reach * reach) stale.reset(numbers[i]);
      }
    });
    level.sampleBrick(node, exposed, stale);
  });
  forEachBrick([&](std::size_t node, const BrickLevel::SampleBits&) { level.copyApron(node); });
  forEachBrick([&](std::size_t node, const BrickLevel::SampleBits& inside) {
    std::int16_t* samples = level.samplesOf(level.slot[node]);
    for (int k = 0; k < BrickLevel::kSamples; ++k) {
      if (inside[static_cast<std::size_t>(k)]) samples[k] = static_cast<std::int16_t>(-samples[k]);
    }
  });
}

/// [bricks] Per coarse brick a lower bound of the distance from its centre to the surface: the Euclidean
/// distance transform of the bricks that contain surface, separably along each axis.
std::vector<float> brickDistances(const BrickLevel& coarse, ParallelWork& work) {
  constexpr float kNone = std::numeric_limits<float>::max();
  std::vector<float> squared(coarse.nodes(), kNone);
  work.run(coarse.nodes(), 1024, [&](std::size_t node) {
    const std::int32_t slot = coarse.slot[node];
    if (slot < 0) return;
    // a surface in the brick is within half a voxel's diagonal of one of its samples
    constexpr auto kTouchQuanta = static_cast<int>(structures::DistanceField::kHalfDiagonal *
                                                   structures::DistanceField::kQuantaPerVoxel) +
                                  1;
    const std::int16_t* samples = coarse.samplesOf(slot);
    const bool surface = std::any_of(samples, samples + BrickLevel::kSamples,
                                     [](int s) { return std::abs(s) <= kTouchQuanta; });
    if (surface) squared[node] = 0.0F;
  });
  const std::array<std::size_t, 3> size{static_cast<std::size_t>(coarse.bricks.x()),
                                        static_cast<std::size_t>(coarse.bricks.y()),
                                        static_cast<std::size_t>(coarse.bricks.z())};
  std::size_t stride = 1;
  for (const std::size_t count : size) {
    const std::size_t lines = coarse.nodes() / count;
    work.run(lines, 64, [&](std::size_t line) {
      const std::size_t first = line / stride * stride * count + line % stride;
      std::vector<float> along(count);
      for (std::size_t i = 0; i < count; ++i) along[i] = squared[first + i * stride];
      for (std::size_t i = 0; i < count; ++i) {
        float best = along[i];
        for (std::size_t away = 1; away < count; ++away) {
          const float gap = static_cast<float>(away) - 0.5F;
          if (gap * gap >= best) break;
          if (away <= i) best = std::min(best, along[i - away] + gap * gap);
          if (i + away < count) best = std::min(best, along[i + away] + gap * gap);
        }
        squared[first + i * stride] = best;
      }
    });
    stride *= count;
  }
  for (float& value : squared) value = std::sqrt(value) * 0.9999F;
  return squared;
}

/// Numbers the bricks that have the surface within their band; all others become far bricks.
class Assembler {
 public:
  explicit Assembler(structures::FieldStorage& storage) : storage_(storage) {}

  Entry entryOf(const BrickLevel& level, std::size_t node) {
    const std::int32_t slot = level.slot[node];
    if (slot < 0)
      return level.free[node] != 0 ? structures::DistanceField::kFarOutside
                                   : structures::DistanceField::kFarInside;
    const std::int16_t* samples = level.samplesOf(slot);
    const auto band = static_cast<int>(level.bandOf(node) * structures::DistanceField::kQuantaPerVoxel);
    const bool in_band =
        std::any_of(samples, samples + BrickLevel::kSamples, [band](int s) { return std::abs(s) < band; });
    if (!in_band)
      return samples[kCentreSample] < 0 ? structures::DistanceField::kFarInside
                                        : structures::DistanceField::kFarOutside;
    storage_.samples.insert(storage_.samples.end(), samples, samples + BrickLevel::kSamples);
    return static_cast<Entry>(storage_.samples.size() / structures::DistanceField::kBrickSamples) - 1;
  }

 private:
  structures::FieldStorage& storage_;
};

structures::FieldStorage assemble(structures::FieldStorage storage, const BrickLevel& coarse,
                                  const BrickLevel* fine, std::span<const std::uint32_t> refined,
                                  ParallelWork& work) {
  const std::vector<float> away = brickDistances(coarse, work);
  Assembler assembler(storage);
  std::size_t block = 0;
  for (std::size_t node = 0; node < coarse.nodes(); ++node) {
    const Entry entry = assembler.entryOf(coarse, node);
    storage.index[node] = entry;
    if (entry >= 0) {
      const double at_centre = coarse.samplesOf(coarse.slot[node])[kCentreSample];
      storage.far[node] =
          structures::quantizedFar(at_centre / structures::DistanceField::kQuantaPerVoxel, 1.0, false);
    } else {
      const bool inside = entry == structures::DistanceField::kFarInside;
      const double bound = static_cast<double>(away[node]) * structures::DistanceField::kBrickVoxels;
      storage.far[node] = structures::quantizedFar(inside ? -bound : bound, 1.0, inside);
    }
    if (block == refined.size() || refined[block] != node) continue;
    const auto children = static_cast<std::size_t>(fine->refinement * fine->refinement * fine->refinement);
    if (entry >= 0) {
      storage.index[node] = structures::DistanceField::kRefined + static_cast<Entry>(storage.index.size());
      for (std::size_t child = 0; child < children; ++child) {
        storage.index.push_back(assembler.entryOf(*fine, block * children + child));
      }
      storage.index.push_back(entry);
    }
    ++block;
  }
  return storage;
}

}  // namespace

Result<BakedField> bakeField(const WeldedMesh& mesh, const BakeOptions& options, ParallelWork& work,
                             const FieldLimits& limits) {
  const std::span<const structures::Triangle> triangles = mesh.triangles;
  if (const std::string why = whyTooLarge(triangles, options, limits); !why.empty()) return fail(why);
  const auto tooMany = [&options](std::size_t bricks, std::size_t limit, bool refined) {
    return fail(tooManyBricks(static_cast<double>(bricks), limit, refined, options));
  };
  Eigen::AlignedBox3d box;
  for (const structures::Triangle& t : triangles) box.extend(structures::boxOf(t));
  structures::FieldStorage storage = structures::makeGrid(box, options.voxel);
  const auto& counts = storage.layout.bricks;
  if (*std::max_element(counts.begin(), counts.end()) > structures::DistanceField::kMaxBricksPerAxis)
    return fail("the mesh is longer than 8,000,000 voxels; choose larger ones");
  BrickLevel coarse(storage.layout.p_MoFo_M, options.voxel, {counts[0], counts[1], counts[2]});
  work.stage("building the triangle tree", 0.05, 0.15);
  const double longest = 2.0 * BrickLevel::kVoxels * options.voxel;
  TriangleTree tree(triangles, longest);
  work.stage("measuring distances", 0.15, 0.45);
  const std::size_t sampled = coarse.sampleDistances(tree, limits.level_bricks, work);
  if (sampled > limits.level_bricks) return tooMany(sampled, limits.level_bricks, false);
  work.stage("flood fill from outside", 0.45, 0.55);
  if (!work.cancelled()) findOutside(coarse, nullptr, tree, work);

  std::unique_ptr<BrickLevel> fine;
  RefinedBricks refined;
  BrickMarks thin;
  if (options.refinement > 1 && !work.cancelled()) {
    // two fine voxels are needed to resolve a gap
    const double narrowest = 2.0 * options.voxel / options.refinement;
    work.stage("looking for narrow gaps", 0.55, 0.58);
    const std::vector<AirGap> gaps = findAirGaps(coarse, triangles, tree, narrowest, work);
    thin = thinBricks(coarse, work);
    refined = bricksToRefine(coarse, options, gaps, thin, limits);
  }
  if (!refined.bricks.empty() && !work.cancelled()) {
    work.stage("refining", 0.58, 0.65);
    fine = std::make_unique<BrickLevel>(coarse, options.refinement, refined.bricks, refined.dilations);
    const std::size_t sampled_fine = fine->sampleDistances(tree, limits.level_bricks, work);
    if (sampled_fine > limits.level_bricks) return tooMany(sampled_fine, limits.level_bricks, true);
    if (!work.cancelled()) findOutside(*fine, &coarse, tree, work);
    if (!work.cancelled()) adoptFineSigns(coarse, *fine, work);
  }
  if (work.cancelled()) return fail("cancelled");

  work.stage("removing interior triangles", 0.65, 0.75);
  const ExposedSurface surface(triangles, coarse, fine.get(), work);
  work.stage("measuring interior distances", 0.75, 0.85);
  BakedField baked;
  baked.surface = surface.all();
  baked.filled = findFilledSpaces(surface.hidden(), tree, mesh.winding, coarse, work);
  std::vector<structures::Triangle> hidden;
  for (std::uint32_t i = 0; i < triangles.size(); ++i) {
    if (surface.of(i).empty()) ++baked.hidden_triangles;
    if (!surface.whole(i)) hidden.push_back(triangles[i]);
  }
  std::array<std::optional<TriangleTree>, 2> trees;
  work.run(trees.size(), 1, [&](std::size_t i) {
    trees[i].emplace(i == 0 || hidden.empty() ? std::span<const structures::Triangle>(hidden) : baked.surface,
                     longest);
  });
  if (work.cancelled()) return fail("cancelled");
  const auto& [hidden_tree, exposed] = trees;
  finishSamples(coarse, *exposed, *hidden_tree, work);
  limitSlope(coarse, nullptr, work);
  if (fine) {
    finishSamples(*fine, *exposed, *hidden_tree, work);
    limitSlope(*fine, &coarse, work);
  }
  baked.surface_tree = hidden.empty() ? std::move(tree) : std::move(*trees[1]);
  if (!hidden.empty()) baked.mesh_tree = std::move(tree);
  baked.thin = thinBricks(coarse, work);
  if (fine) baked.thin.keepThoseOf(thin);
  baked.refined_gaps = std::move(refined.refined_gaps);
  baked.coarse_gaps = std::move(refined.coarse_gaps);
  if (work.cancelled()) return fail("cancelled");

  storage.layout.refinement = fine ? options.refinement : 1;
  work.stage("assembling the field", 0.85, 0.88);
  baked.storage = assemble(std::move(storage), coarse, fine.get(), refined.bricks, work);
  const std::size_t stored = baked.storage.samples.size() / BrickLevel::kSamples;
  if (stored > limits.field_bricks) return tooMany(stored, limits.field_bricks, fine != nullptr);
  if (const auto problem = structures::problemOf(structures::viewOf(baked.storage).layout()))
    return fail("the field " + *problem + "; choose larger voxels");
  return baked;
}

}  // namespace tenon::bake
