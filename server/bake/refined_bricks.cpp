#include "server/bake/refined_bricks.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <span>

namespace tenon::bake {

namespace {

using Cell = BrickLevel::Cell;

bool hasSurface(const BrickLevel& coarse, std::size_t node) {
  const std::int32_t slot = coarse.slot[node];
  if (slot < 0) return false;
  constexpr int kCentre = (4 * BrickLevel::kSide + 4) * BrickLevel::kSide + 4;
  const std::int16_t* s = coarse.samplesOf(slot);
  const double at_centre = s[kCentre] / double{structures::DistanceField::kQuantaPerVoxel};
  if (at_centre < std::min(BrickLevel::kBrickRadius, structures::DistanceField::kClampVoxels)) return true;
  // clamped at the centre: the surface is at a corner or not in the brick at all
  return *std::min_element(s, s + BrickLevel::kSamples) <= structures::DistanceField::kQuantaPerVoxel;
}

constexpr double kBrickBytes = sizeof(std::int16_t) * BrickLevel::kSamples;

double bytesOfUnrefined(const BrickLevel& coarse) {
  constexpr auto kBand =
      static_cast<int>(structures::DistanceField::kBandVoxels * structures::DistanceField::kQuantaPerVoxel);
  const auto in_band = std::count_if(coarse.slot.begin(), coarse.slot.end(), [&](std::int32_t slot) {
    if (slot < 0) return false;
    const std::int16_t* s = coarse.samplesOf(slot);
    return std::any_of(s, s + BrickLevel::kSamples, [](int sample) { return std::abs(sample) < kBand; });
  });
  constexpr double kPerBrick = sizeof(structures::DistanceField::Entry) + sizeof(std::int16_t);
  return static_cast<double>(in_band) * kBrickBytes + static_cast<double>(coarse.nodes()) * kPerBrick;
}

/// The number of the corner of a brick at lattice point `corner` of the grid of bricks.
std::size_t cornerNumber(const Cell& corner, const Cell& bricks) {
  const auto row = static_cast<std::size_t>(bricks.x()) + 1;
  const auto rows = static_cast<std::size_t>(bricks.y()) + 1;
  return (static_cast<std::size_t>(corner.z()) * rows + static_cast<std::size_t>(corner.y())) * row +
         static_cast<std::size_t>(corner.x());
}

Cell cornerOffset(int corner) { return {corner & 1, corner >> 1 & 1, corner >> 2 & 1}; }

std::vector<BrickLevel::CornerDilations> mostDilations(const BrickLevel& coarse, int refinement,
                                                       const BrickMarks& thin,
                                                       std::span<const std::uint32_t> refined) {
  constexpr auto kCoarse = static_cast<float>(structures::DistanceField::kHalfDiagonal);
  std::vector<std::uint8_t> is_refined(coarse.nodes(), 0);
  for (const std::uint32_t node : refined) is_refined[node] = 1;
  std::vector<float> most(cornerNumber(coarse.bricks, coarse.bricks) + 1,
                          kCoarse / static_cast<float>(refinement));
  for (std::size_t node = 0; node < coarse.nodes(); ++node) {
    if (is_refined[node] != 0 || !thin[node]) continue;
    for (int k = 0; k < 8; ++k)
      most[cornerNumber(coarse.brickOf(node) + cornerOffset(k), coarse.bricks)] = kCoarse;
  }
  std::vector<BrickLevel::CornerDilations> dilations;
  dilations.reserve(refined.size());
  for (const std::uint32_t node : refined) {
    BrickLevel::CornerDilations& corners = dilations.emplace_back();
    for (int k = 0; k < 8; ++k) {
      corners[static_cast<std::size_t>(k)] =
          most[cornerNumber(coarse.brickOf(node) + cornerOffset(k), coarse.bricks)];
    }
  }
  return dilations;
}

/// Marks bricks to be refined.
class BrickChooser {
 public:
  BrickChooser(const BrickLevel& coarse, int refinement, const BrickMarks& thin)
      : coarse_(coarse), refinement_(refinement), thin_(thin), marks_(coarse.nodes(), kNot) {}

  [[nodiscard]] bool isWanted(std::size_t node) const { return marks_[node] == kWanted; }

  void want(std::size_t node) { marks_[node] = kWanted; }

  void wantNeighbours(std::size_t node) {
    for (const std::size_t neighbour : thinNeighbours(node)) marks_[neighbour] = kBeside;
  }

  /// Marks the brick of a gap and its neighbours when that takes no more than `bytes`, which it lowers.
  bool wantGap(std::size_t node, double& bytes) {
    const std::vector<std::size_t> thin = thinNeighbours(node);
    double cost = marks_[node] == kBeside ? 0.0 : bytesOf(node, 0.0);
    for (const std::size_t neighbour : thin)
      if (neighbour != node)
        cost += bytesOf(neighbour, structures::DistanceField::kHalfDiagonal * (refinement_ - 1));
    if (cost > bytes) return false;
    bytes -= cost;
    wantNeighbours(node);
    want(node);
    return true;
  }

  [[nodiscard]] std::vector<std::uint32_t> list() const {
    std::vector<std::uint32_t> bricks;
    for (std::size_t node = 0; node < marks_.size(); ++node)
      if (marks_[node] != kNot) bricks.push_back(static_cast<std::uint32_t>(node));
    return bricks;
  }

 private:
  enum Mark : std::uint8_t { kNot, kWanted, kBeside };

  /// The neighbours of a brick where material is thin, that are not marked yet.
  [[nodiscard]] std::vector<std::size_t> thinNeighbours(std::size_t node) const {
    std::vector<std::size_t> thin;
    for (int k = 0; k < 27; ++k) {
      const std::int64_t next =
          coarse_.nodeAt(coarse_.brickOf(node) + Cell(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
      if (next < 0) continue;
      const auto neighbour = static_cast<std::size_t>(next);
      if (marks_[neighbour] == kNot && thin_[neighbour] && hasSurface(coarse_, neighbour))
        thin.push_back(neighbour);
    }
    return thin;
  }

  /// An upper bound of the bytes that a brick's children take, with samples up to `beyond` [voxels of theirs]
  /// beyond the band.
  [[nodiscard]] double bytesOf(std::size_t node, double beyond) const {
    const double reach =
        (structures::DistanceField::kBandVoxels + beyond + BrickLevel::kBrickRadius) / refinement_;
    const double edge = static_cast<double>(BrickLevel::kVoxels) / refinement_;
    double bytes = sizeof(structures::DistanceField::Entry) * (std::pow(refinement_, 3) + 1.0);
    for (int z = 0; z < refinement_; ++z) {
      for (int y = 0; y < refinement_; ++y) {
        for (int x = 0; x < refinement_; ++x) {
          const Vector3 centre = edge * (Vector3(x, y, z) + Vector3::Constant(0.5));
          if (coarse_.interpolated(node, centre) < reach) bytes += kBrickBytes;
        }
      }
    }
    return bytes;
  }

  const BrickLevel& coarse_;
  const int refinement_;
  const BrickMarks& thin_;
  std::vector<std::uint8_t> marks_;
};

}  // namespace

RefinedBricks bricksToRefine(const BrickLevel& coarse, const BakeOptions& options,
                             std::span<const AirGap> gaps, const BrickMarks& thin,
                             const FieldLimits& limits) {
  RefinedBricks refined;
  if (options.refinement <= 1) return refined;
  BrickChooser chooser(coarse, options.refinement, thin);
  std::vector<std::size_t> wanted;
  const double edge = coarse.voxel * BrickLevel::kVoxels;
  for (std::size_t node = 0; node < coarse.nodes(); ++node) {
    const Vector3 p_MBo = coarse.position(coarse.brickOf(node) * BrickLevel::kVoxels);
    const Eigen::AlignedBox3d box(p_MBo, p_MBo + Vector3::Constant(edge));
    const bool in_box = std::any_of(options.refine.begin(), options.refine.end(),
                                    [&box](const RefineBox& region) { return region.box_M.intersects(box); });
    if (in_box && hasSurface(coarse, node)) wanted.push_back(node);
  }
  for (const std::size_t node : wanted) chooser.want(node);
  for (const std::size_t node : wanted) chooser.wantNeighbours(node);
  const double unrefined = bytesOfUnrefined(coarse);
  double bytes =
      std::min(kGapBytes * unrefined, kBrickBytes * static_cast<double>(limits.field_bricks) - unrefined);
  for (const AirGap& gap : gaps) {
    if (chooser.isWanted(gap.brick) || !hasSurface(coarse, gap.brick)) continue;
    const bool fits = refined.coarse_gaps.empty() && chooser.wantGap(gap.brick, bytes);
    (fits ? refined.refined_gaps : refined.coarse_gaps).push_back(gap);
  }
  refined.bricks = chooser.list();
  refined.dilations = mostDilations(coarse, options.refinement, thin, refined.bricks);
  return refined;
}

}  // namespace tenon::bake
