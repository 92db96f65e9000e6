#include "server/bake/field_size.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "server/bake/triangle_tree.h"

namespace tenon::bake {

namespace {

using structures::DistanceField;

/// [-] An estimate may exceed a limit by this before it is refused: what is refused then does not fit.
constexpr double kEstimateError = 1.25;
/// [-] A suggested voxel is larger by this than the one that just fits.
constexpr double kReserve = 1.05;
/// Blocks of a level that are descended into; the others are represented by them.
constexpr std::size_t kSampleBlocks = 4096;
constexpr double kBytesPerBrick = 2.0 * DistanceField::kBrickSamples;
constexpr double kBytesPerGridBrick = sizeof(DistanceField::Entry) + sizeof(std::int16_t);

/// A cube of the octree.
struct Block {
  Vector3 p_MC;  // centre
  double edge;   // [m]
  Eigen::AlignedBox3d box() const {
    return {p_MC - Vector3::Constant(edge / 2), p_MC + Vector3::Constant(edge / 2)};
  }
};

/// Keeps every n-th block and returns n.
double thinOut(std::vector<Block>& blocks) {
  if (blocks.size() <= kSampleBlocks) return 1.0;
  const double step = static_cast<double>(blocks.size()) / static_cast<double>(kSampleBlocks);
  for (std::size_t i = 0; i < kSampleBlocks; ++i)
    blocks[i] = blocks[static_cast<std::size_t>((static_cast<double>(i) + 0.5) * step)];
  blocks.resize(kSampleBlocks);
  return step;
}

/// Whether a sample of the brick is in the band. Of its lattice points the corners, and those in the middle
/// of edges, faces and the brick, decide that but for surfaces that are bent within a voxel.
bool hasSampleInBand(const TriangleTree& tree, const Block& brick) {
  const double band = DistanceField::kBandVoxels * brick.edge / DistanceField::kBrickVoxels;
  for (int i = 0; i < 27; ++i) {
    const Vector3 offset(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
    if (tree.anyWithin(brick.p_MC + offset * (brick.edge / 2), band)) return true;
  }
  return false;
}

/// Bricks with samples of edge `brick` [m] in the cube of bricks `root` [bricks, a power of 2] from `corner`;
/// those in `regions` alone, unless there are none.
double countBricks(const TriangleTree& tree, const Vector3& corner, double root, double brick,
                   std::span<const Eigen::AlignedBox3d> regions) {
  const double band = DistanceField::kBandVoxels * brick / DistanceField::kBrickVoxels;
  std::vector<Block> blocks{{corner + Vector3::Constant(root * brick / 2), root * brick}};
  double weight = 1.0;
  for (double edge = root * brick; edge > 1.5 * brick;) {
    edge /= 2;
    weight *= thinOut(blocks);
    std::vector<Block> children;
    for (const Block& block : blocks) {
      for (int i = 0; i < 8; ++i) {
        const Vector3 offset((i & 1) - 0.5, (i >> 1 & 1) - 0.5, (i >> 2 & 1) - 0.5);
        const Block child{block.p_MC + offset * edge, edge};
        const bool wanted = regions.empty() || std::any_of(regions.begin(), regions.end(),
                                                           [&child](const Eigen::AlignedBox3d& region) {
                                                             return region.intersects(child.box());
                                                           });
        constexpr double kHalfDiagonal = 0.8661;  // [edges]
        if (wanted && tree.anyWithin(child.p_MC, kHalfDiagonal * edge + band)) children.push_back(child);
      }
    }
    blocks = std::move(children);
  }
  weight *= thinOut(blocks);
  return weight *
         static_cast<double>(std::count_if(blocks.begin(), blocks.end(), [&tree](const Block& block) {
           return hasSampleInBand(tree, block);
         }));
}

/// "0.0214 mm", with up to three digits.
std::string millimetres(double metres) {
  char text[40];
  std::snprintf(text, sizeof text, "%.3g mm", metres * 1e3);
  return text;
}

/// [m] `voxel` times `factor`, rounded up to two digits.
double roundedUp(double voxel, double factor) {
  const double wanted = voxel * factor;
  const double digit = std::pow(10.0, std::floor(std::log10(wanted)) - 1.0);
  return std::ceil(wanted / digit) * digit;
}

/// A number of bricks with three digits: "3.07 million".
std::string inMillions(double bricks) {
  char text[40];
  const bool billions = bricks >= 1e9;
  std::snprintf(text, sizeof text, "%.3g %s", bricks / (billions ? 1e9 : 1e6),
                billions ? "billion" : "million");
  return text;
}

std::string sentence(double voxel, double bricks, double bytes, double limit, const std::string& help) {
  char size[40];
  const bool terabytes = bytes >= 1e12;
  std::snprintf(size, sizeof size, "%.3g %s", bytes / (terabytes ? 1e12 : 1e9), terabytes ? "TB" : "GB");
  return "voxels of " + millimetres(voxel) + " make a field of about " + inMillions(bricks) + " bricks (" +
         size + ") of this mesh, at most " + inMillions(limit) + " fit; " + help;
}

/// [bricks] along each axis of the coarse grid.
Vector3 gridOf(const Eigen::AlignedBox3d& box, double edge) {
  return (box.sizes() / edge).array().ceil().max(1.0) + 2.0;
}

Eigen::AlignedBox3d boxOf(std::span<const structures::Triangle> triangles) {
  Eigen::AlignedBox3d box;
  for (const structures::Triangle& t : triangles) box.extend(structures::boxOf(t));
  return box;
}

/// Whether the grid fits, and the area of the surface asks for far fewer bricks than fit: then nothing is
/// estimated.
bool isSmall(std::span<const structures::Triangle> triangles, const BakeOptions& options,
             const FieldLimits& limits) {
  constexpr double kBricksPerArea = 2.8;  // of a plane, per area of a brick's face
  constexpr double kFarFewer = 0.25;
  double area = 0.0;
  for (const structures::Triangle& t : triangles) area += structures::areaOf(t);
  const double coarse = options.voxel * DistanceField::kBrickVoxels;
  const double finest = options.refine.empty() ? coarse : coarse / options.refinement;
  const auto limit = static_cast<double>(std::min(limits.level_bricks, limits.field_bricks));
  return gridOf(boxOf(triangles), coarse).prod() <= limits.grid_bricks &&
         kBricksPerArea * area / (finest * finest) < kFarFewer * limit;
}

}  // namespace

FieldSize estimateSize(std::span<const structures::Triangle> triangles, const BakeOptions& options) {
  const Eigen::AlignedBox3d box = boxOf(triangles);
  const double edge = options.voxel * DistanceField::kBrickVoxels;
  const Vector3 counts = gridOf(box, edge);
  const double root = std::exp2(std::ceil(std::log2(counts.maxCoeff())));
  const Vector3 corner = box.min() - Vector3::Constant(edge);
  // in pieces that are small beside the mesh, whatever the voxel
  const TriangleTree tree(triangles, std::max(box.diagonal().norm() / 64, 2.0 * edge));
  FieldSize size;
  size.grid = counts.prod();
  size.coarse = countBricks(tree, corner, root, edge, {});
  if (options.refinement <= 1 || options.refine.empty()) return size;
  // a coarse brick is refined as a whole
  std::vector<Eigen::AlignedBox3d> regions;
  for (const RefineBox& region : options.refine) {
    const auto down = [&](const Vector3& p) { return Vector3(((p - corner) / edge).array().floor()); };
    regions.emplace_back(corner + down(region.box_M.min()) * edge,
                         corner + (down(region.box_M.max()) + Vector3::Ones()) * edge);
    // bricks beside it are beyond its faces
    regions.back().min().array() += 1e-9 * edge;
    regions.back().max().array() -= 1e-9 * edge;
  }
  size.refined = countBricks(tree, corner, root * options.refinement, edge / options.refinement, regions);
  return size;
}

std::string tooManyBricks(double bricks, std::size_t limit, bool refined, const BakeOptions& options) {
  const double factor = std::sqrt(bricks / static_cast<double>(limit)) * kReserve;
  const double voxel = refined ? options.voxel / options.refinement : options.voxel;
  std::string help = "choose voxels of " + millimetres(roundedUp(voxel, factor)) + " or more";
  if (refined) help += " there, or smaller boxes to refine";
  return sentence(voxel, bricks, bricks * kBytesPerBrick, static_cast<double>(limit), help);
}

std::string whyTooLarge(std::span<const structures::Triangle> triangles, const BakeOptions& options,
                        const FieldLimits& limits) {
  if (isSmall(triangles, options, limits)) return {};
  const FieldSize size = estimateSize(triangles, options);
  if (!(size.grid <= limits.grid_bricks)) {
    const double by_samples = std::sqrt(size.coarse / static_cast<double>(limits.level_bricks));
    const double factor = std::max(std::cbrt(size.grid / limits.grid_bricks), by_samples) * kReserve;
    return sentence(options.voxel, size.grid, size.grid * kBytesPerGridBrick + size.coarse * kBytesPerBrick,
                    limits.grid_bricks,
                    "choose voxels of " + millimetres(roundedUp(options.voxel, factor)) + " or more");
  }
  const auto exceeds = [](double bricks, std::size_t limit) {
    return bricks > kEstimateError * static_cast<double>(limit);
  };
  if (exceeds(size.coarse, limits.level_bricks))
    return tooManyBricks(size.coarse, limits.level_bricks, false, options);
  if (exceeds(size.refined, limits.level_bricks))
    return tooManyBricks(size.refined, limits.level_bricks, true, options);
  const double all = size.coarse + size.refined;
  if (exceeds(all, limits.field_bricks))
    return tooManyBricks(all, limits.field_bricks, size.refined > size.coarse, options);
  return {};
}

}  // namespace tenon::bake
