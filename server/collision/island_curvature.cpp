#include <algorithm>
#include <array>
#include <cmath>

#include "server/collision/island_job.h"

namespace tenon::collision {
namespace {

/// [voxels] Curvature is taken from gradients at this offset to each side of a contact.
constexpr double kSampleOffset = 0.25;

/// [rad] It counts when the normal turns by more than this between them: discretisation turns it by less.
constexpr double kMinTurn = 0.02;

/// [rad] A larger turn may be a normal discontinuity between two cells: secondary planes are added.
constexpr double kSharpTurn = 0.1;

/// [-] Where the field's slope is less, the gradient gives no plane.
constexpr double kMinPlaneSlope = 0.3;

/// [-] Planes whose normals have a larger cosine are one.
constexpr double kOneNormal = 1.0 - 1e-6;

/// A principal direction of a field's level set in which it is concave, as seen from outside.
struct ConcaveDirection {
  Vector3 direction_W = Vector3::Zero();
  double curvature = 0.0;  ///< [1/m]
};

/// The concave principal directions at a contact. Where the normal turns abruptly, the tangent planes to both
/// sides are appended to `secondary_planes`: in a concave place they constrain the point as well. Where the
/// bake has found the planes there (DistanceField::planesAt) these are appended, and nothing is curved.
FixedVector<ConcaveDirection, 2> concaveDirections(const ContactSurface& surface, const Contact& contact,
                                                   FixedVector<Contact, 4>& secondary_planes) {
  FixedVector<ConcaveDirection, 2> directions;
  if (surface.field == nullptr) return directions;
  const Pose& X_WB = *surface.X_WF;
  const Vector3 p_BP = X_WB.inverse() * contact.p_WP;
  const Vector3 n_B = X_WB.rotation().conjugate() * (surface.sign * contact.n_W);
  const double h = kSampleOffset * surface.field->voxelAt(p_BP);
  if (const auto planes = surface.field->planesAt(p_BP); !planes.empty()) {
    const double dilation = surface.field->dilationBeyond(surface.most_dilation, p_BP);
    for (const structures::ValleyPlane& known : planes) {
      Contact plane = contact;
      plane.gap = known.distance(p_BP - surface.field->layout().p_MoFo_M) + dilation;
      plane.n_W = X_WB.rotation() * (surface.sign * known.n_M.cast<double>());
      plane.area = 0.0;
      if (plane.n_W.dot(contact.n_W) < kOneNormal) secondary_planes.push_back(plane);
    }
    return directions;
  }
  const std::array<Vector3, 2> t = tangentsOf(n_B);
  Eigen::Matrix2d turn;
  for (int side = 0; side < 2; ++side) {
    const Vector3& along = t[static_cast<std::size_t>(side)];
    const structures::FieldSample ahead = surface.sample(p_BP + h * along);
    const structures::FieldSample behind = surface.sample(p_BP - h * along);
    if (!ahead.exact || !behind.exact) return directions;
    turn(0, side) = (behind.gradient - ahead.gradient).dot(t[0]);
    turn(1, side) = (behind.gradient - ahead.gradient).dot(t[1]);
    if (turn(side, side) < kSharpTurn) continue;
    for (const double offset : {h, -h}) {
      const structures::FieldSample& sample = offset > 0.0 ? ahead : behind;
      const double slope = sample.gradient.norm();
      if (slope < kMinPlaneSlope) continue;
      Contact plane = contact;
      plane.gap = (sample.distance - offset * sample.gradient.dot(along)) / slope;
      plane.n_W = X_WB.rotation() * (surface.sign * (sample.gradient / slope));
      plane.area = 0.0;
      // with a smaller gap, the surface is convex between the contact and the sample
      if (plane.gap >= contact.gap - kFieldNoise) secondary_planes.push_back(plane);
    }
  }
  const double mean = 0.5 * (turn(0, 0) + turn(1, 1));
  const double half = 0.5 * (turn(0, 0) - turn(1, 1));
  const double mixed = 0.5 * (turn(0, 1) + turn(1, 0));
  const double spread = std::sqrt(half * half + mixed * mixed);
  for (const double sign : {1.0, -1.0}) {
    const double value = mean + sign * spread;
    if (value < kMinTurn) continue;
    // of the two forms of the eigenvector the longer one, for its accuracy
    Vector3 along = half * sign >= 0.0 ? Vector3((spread + sign * half) * t[0] + sign * mixed * t[1])
                                       : Vector3(mixed * t[0] + (sign * spread - half) * t[1]);
    if (spread == 0.0) along = t[sign > 0.0 ? 0 : 1];
    directions.push_back({X_WB.rotation() * along.normalized(), value / (2.0 * h)});
  }
  return directions;
}

}  // namespace

bool IslandSolver::evaluateCurvature(const Job& job) {
  for (MovableBody& body : job.bodies) {
    body.curvatures.clear();
    body.friction_Bq_W = Wrench{};
  }
  rows_.resize(contact_row_count_);
  curvature_rows_.clear();
  secondary_plane_count_ = 0;
  bool any = false;
  std::size_t i = 0;
  std::size_t first = 0;
  for (const std::uint32_t row : active_) {
    if (row >= contact_row_count_) break;
    curvature_rows_.push_back(row);
    while (row >= first + job.results[i].query.contacts.size())
      first += job.results[i++].query.contacts.size();
    const IslandPair& pair = job.pairs[i];
    const Contact& contact = job.results[i].query.contacts[row - first];
    FixedVector<Contact, 4> secondary_planes;
    const auto directions = concaveDirections(job.surfaceOf(pair, contact), contact, secondary_planes);
    for (const Contact& plane : secondary_planes) {
      if (secondary_plane_count_ == secondary_planes_.size()) break;
      secondary_planes_[secondary_plane_count_++] = {i, plane};
      rows_.push_back({pair.body_a, pair.body_b, plane.n_W, plane.p_WP, plane.gap});
    }
    for (const ConcaveDirection& direction : directions) {
      for (const std::int32_t index : {pair.body_a, pair.body_b}) {
        if (index == ContactConstraint::kStatic) continue;
        MovableBody& body = job.bodies[static_cast<std::size_t>(index)];
        const Vector3 arm = contact.p_WP - body.p_WQ();
        any |= body.curvatures.push_back({{direction.direction_W, arm.cross(direction.direction_W)},
                                          multipliers_[row] * direction.curvature});
      }
    }
  }
  // active rows of secondary planes are dropped: their numbers are no longer valid
  active_.resize(curvature_rows_.size());
  return any || secondary_plane_count_ > 0;
}

bool IslandSolver::curvatureIsOfActiveRows() const {
  const auto end = std::find_if(active_.begin(), active_.end(),
                                [this](std::uint32_t row) { return row >= contact_row_count_; });
  return std::equal(active_.begin(), end, curvature_rows_.begin(), curvature_rows_.end());
}

}  // namespace tenon::collision
