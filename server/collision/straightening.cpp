#include "server/collision/straightening.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace tenon {

namespace {

/// [voxels] Two reach past the bend of a wall that is up to four voxels thick, and past the surface of a
/// thinner one.
constexpr double kWay = 2.0;

/// [voxels] What interpolation may err by, for each unit that the square of its slope is less than one. At
/// most it errs by 0.87; a little less than in proportion was best on parts of CAD.
constexpr double kErrorOfBend = 0.65;

/// The cosine of 8 degrees.
constexpr double kSameNormal = 0.99;

/// A plane may be so much above the interpolation [voxels]: beside a concave edge that is too deep.
constexpr double kAbove = 0.1;

/// The corners of a cube, turned by 0.6 rad about (1, 2, 3): along no axis, face or diagonal of the grid.
constexpr std::array<std::array<double, 3>, ProbeSides::kSides / 2> kDirections{
    {{0.43260, 0.73720, 0.51904},
     {-0.53482, 0.18563, 0.82432},
     {0.92654, -0.27344, 0.25835},
     {0.04088, 0.82501, -0.56363}}};

ProbeSides probeSides(double way) {
  ProbeSides sides;
  for (std::size_t k = 0; k < ProbeSides::kSides; ++k) {
    const auto& [x, y, z] = kDirections[k / 2];
    const double along = k % 2 == 0 ? way : -way;
    sides.x[k] = along * x;
    sides.y[k] = along * y;
    sides.z[k] = along * z;
  }
  return sides;
}

Vector3 slopeOf(const Planes& planes, std::size_t k) {
  return {planes.gradient_x[k], planes.gradient_y[k], planes.gradient_z[k]};
}

/// Whether another side tells of the same face.
bool seenTwice(const Planes& planes, std::size_t plane) {
  for (std::size_t k = 0; k < ProbeSides::kSides; ++k) {
    if (k == plane || planes.distance[k] == kNoPlane) continue;
    if (slopeOf(planes, k).dot(slopeOf(planes, plane)) > kSameNormal) return true;
  }
  return false;
}

/// Whether the field goes on along a plane beyond the surface, as in front of a face.
bool facesOutwards(const DistanceField& field, const Vector3& p_BP, double distance, const Vector3& slope,
                   double voxel) {
  const double beyond = 1.5 * voxel;
  const FieldSample there = field.sample(p_BP + (beyond - distance) * slope);
  return there.exact && there.gradient.dot(slope) > kSameNormal &&
         std::abs(there.distance - beyond) < 0.1 * voxel;
}

/// The highest plane that is not above the interpolation, nor below it by more than that may err.
std::size_t highestPlane(const Planes& planes, double interpolated, double voxel, double bend) {
  double best = interpolated - kErrorOfBend * bend * voxel;
  std::size_t highest = ProbeSides::kSides;
  for (std::size_t k = 0; k < ProbeSides::kSides; ++k) {
    if (planes.distance[k] <= best || planes.distance[k] > interpolated + kAbove * voxel) continue;
    best = planes.distance[k];
    highest = k;
  }
  return highest;
}

}  // namespace

void straighten(const LaneFrame& frame, const QueryKernels& kernels, const PointLanes& points,
                std::span<SampleLanes> samples, SampleSums& sums) noexcept {
  std::array<std::uint32_t, Candidates::kMost / ShellBlock::kLanes> bent;
  if (kernels.bent(frame, samples, bent.data()) == 0) return;
  const DistanceField& field = frame.field;
  const ProbeSides sides = probeSides(kWay * field.voxel());
  for (std::size_t b = 0; b < samples.size(); ++b) {
    SampleLanes& block = samples[b];
    for (; bent[b] != 0; bent[b] &= bent[b] - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bent[b]));
      const std::size_t i = b * ShellBlock::kLanes + lane;
      const Vector3 p_BP = frame.inB(Vector3(points.x[i], points.y[i], points.z[i]));
      const double voxel = field.layout().refinement > 1 ? field.voxelAt(p_BP) : field.voxel();
      Planes planes;
      kernels.planes(frame, sides, p_BP, voxel / field.voxel(), planes);
      const Vector3 interpolated(block.gradient_x[lane], block.gradient_y[lane], block.gradient_z[lane]);
      const std::size_t highest =
          highestPlane(planes, block.distance[lane], voxel, 1.0 - interpolated.squaredNorm());
      if (highest == ProbeSides::kSides) continue;
      const Vector3 slope = slopeOf(planes, highest);
      const double distance = planes.distance[highest];
      if (!seenTwice(planes, highest) && !facesOutwards(field, p_BP, distance, slope, voxel)) continue;
      block.distance[lane] = std::min(distance, block.distance[lane]);
      block.gradient_x[lane] = slope.x();
      block.gradient_y[lane] = slope.y();
      block.gradient_z[lane] = slope.z();
      sums.smallest_distance = std::min(sums.smallest_distance, block.distance[lane]);
    }
  }
}

}  // namespace tenon
