#include "tests/support/analytic_structures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace tenon::test {
namespace {

constexpr double kSlabThickness = 0.05;  // [m]

Eigen::AlignedBox3d boxAbout(const Vector3& centre, const Vector3& size) {
  return {centre - 0.5 * size, centre + 0.5 * size};
}

structures::AnalyticDistance boxAt(const Vector3& centre, const Vector3& size) {
  return movedDistance(boxDistance(size), Pose(centre));
}

}  // namespace

StructuresPtr analyticStructures(const structures::AnalyticDistance& distance,
                                 const Eigen::AlignedBox3d& box_M, double voxel,
                                 std::span<const structures::SurfaceSample> samples, double spacing) {
  auto structures = std::make_shared<structures::HapticStructures>();
  structures->field = structures::buildField(distance, box_M, voxel);
  if (!samples.empty()) structures->shell = structures::buildShell(samples, spacing);
  structures->info.source = "analytic";
  structures->info.box_M = box_M;
  for (const structures::SurfaceSample& sample : samples) structures->info.surface_area += sample.area;
  return structures;
}

structures::AnalyticDistance sphereDistance(double radius) {
  return [radius](const Vector3& p) { return p.norm() - radius; };
}

structures::AnalyticDistance boxDistance(const Vector3& size) {
  return [half = Vector3(0.5 * size)](const Vector3& p) {
    const Vector3 q = p.cwiseAbs() - half;
    return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
  };
}

structures::AnalyticDistance movedDistance(structures::AnalyticDistance distance, const Pose& X_MS) {
  return [distance = std::move(distance), X_SM = X_MS.inverse()](const Vector3& p) {
    return distance(X_SM * p);
  };
}

structures::AnalyticDistance unionDistance(structures::AnalyticDistance a, structures::AnalyticDistance b) {
  return [a = std::move(a), b = std::move(b)](const Vector3& p) { return std::min(a(p), b(p)); };
}

structures::AnalyticDistance sheetDistance(double edge) { return boxDistance({edge, edge, 0.0}); }

std::vector<structures::SurfaceSample> sphereSamples(double radius, double spacing) {
  const double area = 4.0 * std::numbers::pi * radius * radius;
  const int count = std::max(12, static_cast<int>(area / (spacing * spacing)));
  // Fibonacci lattice: a spiral from pole to pole in steps of the golden angle
  const double golden = std::numbers::pi * (3.0 - std::sqrt(5.0));
  std::vector<structures::SurfaceSample> samples;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / count;
    const double r = std::sqrt(1.0 - z * z);
    const Vector3 outward(r * std::cos(golden * i), r * std::sin(golden * i), z);
    samples.push_back({radius * outward, -outward, area / count});
  }
  return samples;
}

std::vector<structures::SurfaceSample> boxSamples(const Vector3& size, double spacing) {
  std::array<int, 3> steps{};
  Vector3 step;
  for (int axis = 0; axis < 3; ++axis) {
    steps[axis] = std::max(1, static_cast<int>(std::lround(size[axis] / spacing)));
    step[axis] = size[axis] / steps[axis];
  }
  // a lattice node represents the adjacent part of every face that it lies on
  std::array<std::vector<structures::SurfaceSample>, 4> samples_by_faces;
  for (int i = 0; i <= steps[0]; ++i) {
    for (int j = 0; j <= steps[1]; ++j) {
      for (int k = 0; k <= steps[2]; ++k) {
        const std::array<int, 3> node{i, j, k};
        Vector3 cell = step;
        Vector3 outward = Vector3::Zero();
        for (int axis = 0; axis < 3; ++axis) {
          if (node[axis] != 0 && node[axis] != steps[axis]) continue;
          outward[axis] = node[axis] == 0 ? -1.0 : 1.0;
          cell[axis] *= 0.5;
        }
        const auto faces = static_cast<std::size_t>(outward.cwiseAbs().sum());
        if (faces == 0) continue;
        double area = 0.0;
        for (int axis = 0; axis < 3; ++axis) {
          if (outward[axis] != 0.0) area += cell[(axis + 1) % 3] * cell[(axis + 2) % 3];
        }
        const Vector3 p = Vector3(i, j, k).cwiseProduct(step) - 0.5 * size;
        samples_by_faces[faces].push_back({p, -outward.normalized(), area});
      }
    }
  }
  std::vector<structures::SurfaceSample> samples = std::move(samples_by_faces[3]);
  samples.insert(samples.end(), samples_by_faces[2].begin(), samples_by_faces[2].end());
  samples.insert(samples.end(), samples_by_faces[1].begin(), samples_by_faces[1].end());
  return samples;
}

StructuresPtr sphereStructures(double radius, double voxel, double spacing) {
  return analyticStructures(sphereDistance(radius),
                            boxAbout(Vector3::Zero(), Vector3::Constant(2.0 * radius)), voxel,
                            sphereSamples(radius, spacing), spacing);
}

StructuresPtr boxStructures(const Vector3& size, double voxel, double spacing) {
  return analyticStructures(boxDistance(size), boxAbout(Vector3::Zero(), size), voxel,
                            boxSamples(size, spacing), spacing);
}

StructuresPtr floorStructures(double edge, double voxel) {
  const Vector3 centre(0.0, 0.0, -0.5 * kSlabThickness);
  const Vector3 size(edge, edge, kSlabThickness);
  return analyticStructures(boxAt(centre, size), boxAbout(centre, size), voxel);
}

StructuresPtr cornerStructures(double edge, double voxel) {
  const double t = kSlabThickness;
  // a block without one octant: in the free octant the distance is that to the three planes
  const structures::AnalyticDistance outer =
      boxAt(Vector3::Constant(0.5 * (edge - t)), Vector3::Constant(edge + t));
  const structures::AnalyticDistance distance = [outer, edge](const Vector3& p) {
    const Vector3 beyond = (p - Vector3::Constant(edge)).cwiseMax(0.0);
    if (beyond.squaredNorm() == 0.0) {
      // between the walls: nearest plane in free space, nearest point of the free octant inside the material
      if (p.minCoeff() >= 0.0) return p.minCoeff();
      return std::max(outer(p), -(-p).cwiseMax(0.0).norm());
    }
    // beyond the rims of the walls: distance to the three slabs
    double nearest = 1e9;
    for (int axis = 0; axis < 3; ++axis) {
      Vector3 low = Vector3::Constant(-kSlabThickness);
      Vector3 high = Vector3::Constant(edge);
      high[axis] = 0.0;
      nearest = std::min(nearest, boxAt(0.5 * (low + high), high - low)(p));
    }
    return nearest;
  };
  return analyticStructures(distance, {Vector3::Constant(-t), Vector3::Constant(edge)}, voxel);
}

StructuresPtr sheetStructures(double edge, double thickness, double voxel, double offset) {
  const Vector3 size(edge, edge, thickness);
  const Vector3 centre(0.0, 0.0, offset);
  return analyticStructures(boxAt(centre, size), boxAbout(centre, size), voxel);
}

structures::DistanceField dilated(const structures::DistanceField& field, double dilation) {
  const structures::DistanceField::Layout& layout = field.layout();
  structures::FieldStorage storage{layout,
                                   {layout.index.begin(), layout.index.end()},
                                   {layout.samples.begin(), layout.samples.end()},
                                   {layout.far.begin(), layout.far.end()},
                                   {}};
  std::size_t corners = 1;
  for (const std::int32_t count : layout.bricks) corners *= static_cast<std::size_t>(count) + 1;
  return structures::makeDilatedField(std::move(storage),
                                      std::vector<float>(corners, static_cast<float>(dilation)));
}

StructuresPtr dilated(const StructuresPtr& structures, double dilation) {
  if (dilation == 0.0) return structures;
  auto result = std::make_shared<structures::HapticStructures>(*structures);
  result->field = dilated(structures->field, dilation);
  return result;
}

StructuresPtr socketStructures(const Vector3& hole, double wall, double voxel, double rim_spacing) {
  const Vector3 size(hole.x() + 2.0 * wall, hole.y() + 2.0 * wall, hole.z() + wall);
  const Vector3 centre(0.0, 0.0, -0.5 * size.z());
  const structures::AnalyticDistance block = boxAt(centre, size);
  // the hole extends 1 m upwards, beyond the block
  const Vector3 cut(hole.x(), hole.y(), hole.z() + 1.0);
  const structures::AnalyticDistance inside = boxAt({0.0, 0.0, -hole.z() + 0.5 * cut.z()}, cut);
  const structures::AnalyticDistance distance = [block, inside,
                                                 half = Vector3(0.5 * hole)](const Vector3& p) {
    if (p.z() > 0.0) {
      // above the hole the rim is nearest
      const Vector3 q(std::abs(p.x()), std::abs(p.y()), p.z());
      const double to_rim = std::min(half.x() - q.x(), half.y() - q.y());
      if (to_rim > 0.0) return std::sqrt(to_rim * to_rim + p.z() * p.z());
    }
    return std::max(block(p), -inside(p));
  };
  std::vector<structures::SurfaceSample> rim;
  for (int axis = 0; axis < 2; ++axis) {
    const int steps = std::max(1, static_cast<int>(std::lround(hole[axis] / rim_spacing)));
    const double step = hole[axis] / steps;
    for (const double side : {-1.0, 1.0}) {
      for (int i = 0; i < steps; ++i) {
        Vector3 p = Vector3::Zero();
        p[axis] = (i + 0.5) * step - 0.5 * hole[axis];
        p[1 - axis] = side * 0.5 * hole[1 - axis];
        Vector3 inward = -Vector3::UnitZ();
        inward[1 - axis] = side;
        rim.push_back({p, inward.normalized(), step * step});
      }
    }
  }
  return analyticStructures(distance, boxAbout(centre, size), voxel, rim, rim_spacing);
}

}  // namespace tenon::test
