#include "tests/bench/engine/pose_sets.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>

namespace tenon::bench {

namespace {

// [m] largest gap of a near pose, smallest step, and largest distance beyond the target
constexpr double kNear = 0.015;
constexpr double kMinStep = 20e-6;
constexpr double kOvershoot = 0.02;
constexpr int kMaxSteps = 400;
constexpr double kTouchDepth = 0.05e-3;  // [m] wanted depth of touching poses in the dilated surface

/// The smallest exact gap of A's vertices, to the solids or to their dilated surface.
class ExactGap {
 public:
  /// `dilation_B`: the field whose dilation counts; null: none.
  ExactGap(const bake::TriangleMesh& mesh_A, const test::SolidUnion& truth_B,
           const structures::DistanceField* dilation_B = nullptr)
      : truth_B_(truth_B),
        dilation_B_(dilation_B),
        slope_(dilation_B == nullptr ? 1.0 : dilation_B->slope()) {
    constexpr double kCell = 0.02;  // [m]
    std::map<std::array<std::int64_t, 3>, std::vector<Vector3>> cells;
    for (const Vector3f& vertex : mesh_A.vertices) {
      const Vector3 p = vertex.cast<double>();
      std::vector<Vector3>& cell =
          cells[{std::llround(p.x() / kCell), std::llround(p.y() / kCell), std::llround(p.z() / kCell)}];
      if (std::find(cell.begin(), cell.end(), p) == cell.end()) cell.push_back(p);
    }
    for (auto& [key, vertices] : cells) {
      Cluster cluster;
      for (const Vector3& p : vertices) cluster.centre += p / static_cast<double>(vertices.size());
      for (const Vector3& p : vertices)
        cluster.radius = std::max(cluster.radius, (p - cluster.centre).norm());
      cluster.vertices = std::move(vertices);
      clusters_.push_back(std::move(cluster));
    }
  }

  /// [m] Negative where a vertex is inside. Since the last call no vertex has moved by more than `moved` [m].
  [[nodiscard]] double at(const Pose& X_BA, double moved = std::numeric_limits<double>::infinity()) {
    for (Cluster& cluster : clusters_) cluster.bound -= slope_ * moved;
    std::sort(clusters_.begin(), clusters_.end(),
              [](const Cluster& a, const Cluster& b) { return a.bound < b.bound; });
    double smallest = std::numeric_limits<double>::infinity();
    for (Cluster& cluster : clusters_) {
      if (cluster.bound >= smallest) break;
      cluster.bound = gap(X_BA * cluster.centre) - slope_ * cluster.radius;
      if (cluster.bound >= smallest) continue;
      for (const Vector3& p : cluster.vertices) smallest = std::min(smallest, gap(X_BA * p));
    }
    return smallest;
  }

  /// [-] Gaps of points differ by at most this times the length between them.
  [[nodiscard]] double slope() const { return slope_; }

 private:
  struct Cluster {
    Vector3 centre = Vector3::Zero();
    double radius = 0.0;  ///< [m]
    double bound = 0.0;   ///< [m] lower bound of the gap of all vertices
    std::vector<Vector3> vertices;
  };

  [[nodiscard]] double gap(const Vector3& p_BP) const {
    const double distance = truth_B_.nearest(p_BP).distance;
    const double signed_distance = truth_B_.inside(p_BP) ? -distance : distance;
    return dilation_B_ == nullptr ? signed_distance : signed_distance - dilation_B_->dilationAt(p_BP);
  }

  const test::SolidUnion& truth_B_;
  const structures::DistanceField* dilation_B_;
  double slope_;
  std::vector<Cluster> clusters_;
};

/// Start pose number `index`, at the fraction `fraction` [-] of the spiral.
Pose startOf(const InsertionTask& task, double fraction, std::size_t index) {
  const Vector3 side = task.direction_B.unitOrthogonal();
  const Vector3 other_side = task.direction_B.cross(side);
  const double lateral_offset = task.lateral_offset * (1.0 - fraction) * (1.0 - fraction);
  const auto step = static_cast<double>(index);
  // expRotation instead of sin and cos of the C library, which differ between machines
  const Vector3 around = expRotation(task.direction_B * (0.11 * step)) * side;
  const double tilt = 0.05 * (1.1 - fraction);
  const Vector3 axis = expRotation(task.direction_B * (0.07 * step)) * other_side;
  const Vector3 p = task.X_BT.translation() - task.direction_B * task.reach;
  return {p + around * lateral_offset, expRotation(axis * tilt) * task.X_BT.rotation()};
}

/// A pose and its exact gap [m].
struct Reached {
  Pose X_BA;
  double gap = 0.0;
};

/// Moves a pose along the direction until its gap is at most `gap` [m].
Reached pushed(ExactGap& exact, const InsertionTask& task, Reached from, double gap) {
  const double max_distance = task.reach + kOvershoot;
  double distance = 0.0;
  for (int i = 0; i < kMaxSteps && distance < max_distance && from.gap > gap; ++i) {
    const double step = std::max((from.gap - gap) / exact.slope(), kMinStep);
    from.X_BA.translation() += task.direction_B * step;
    from.gap = exact.at(from.X_BA, step);
    distance += step;
  }
  return from;
}

}  // namespace

Eigen::AlignedBox3d regionOf(const bake::TriangleMesh& mesh_A, const InsertionTask& task) {
  Eigen::AlignedBox3d box_A;
  for (const Vector3f& vertex : mesh_A.vertices) box_A.extend(vertex.cast<double>());
  Eigen::AlignedBox3d region_B;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3 p_B = task.X_BT * box_A.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner));
    region_B.extend(p_B + kOvershoot * task.direction_B);
    region_B.extend(p_B - task.reach * task.direction_B);
  }
  region_B.min().array() -= task.lateral_offset;
  region_B.max().array() += task.lateral_offset;
  return region_B;
}

PoseSets insertionPoses(const bake::TriangleMesh& mesh_A, const test::SolidUnion& truth_B,
                        const structures::DistanceField& field_B, const InsertionTask& task,
                        std::size_t count) {
  ExactGap contact(mesh_A, truth_B, &field_B);
  ExactGap mesh(mesh_A, truth_B);
  PoseSets sets;
  for (std::size_t i = 0; i < count; ++i) {
    Reached at{startOf(task, static_cast<double>(i) / static_cast<double>(count), i), 0.0};
    at.gap = contact.at(at.X_BA);
    if (at.gap >= kNear) sets.free.push_back(at.X_BA);

    constexpr double kLeast = 1e-4;  // [m]
    at = pushed(contact, task, at, kLeast + (kNear - kLeast) * static_cast<double>(1 + i % 14) / 15.0);
    if (at.gap > kLeast && at.gap <= kNear) sets.near.push_back(at.X_BA);

    at = pushed(contact, task, at, -kTouchDepth);
    if (at.gap <= 0.0 && at.gap >= -2.0 * kTouchDepth) sets.touching.push_back(at.X_BA);

    // 0.5 to 5 mm, with a period of 31 poses
    const double depth = 0.5e-3 + 4.5e-3 * static_cast<double>(i * 7 % 31) / 30.0;
    at.gap = mesh.at(at.X_BA);
    at = pushed(mesh, task, at, -depth);
    if (at.gap <= -0.5e-3) sets.pressed.push_back(at.X_BA);
  }
  return sets;
}

}  // namespace tenon::bench
