#include <algorithm>
#include <array>
#include <cmath>

#include "server/collision/island_job.h"

namespace tenon {
namespace {

/// A surface's curve at a contact is seen this far to each side [voxels], and counts when its normal turns
/// by more than this over both [rad]: the field's steps turn it by less.
constexpr double kCurveStep = 0.25;
constexpr double kLeastTurn = 0.02;

/// [rad] So much turn over both sides, and the field's slope there, may be a kink between two of its cells.
constexpr double kSharpTurn = 0.1;
constexpr double kFlankSlope = 0.3;

/// A principal curve of a field's level set, hollow as seen from outside.
struct Hollow {
  Vector3 along_W = Vector3::Zero();
  double curvature = 0.0;  ///< [1/m]
};

/// The hollows round a contact: what pushes the point back to where it is, the more the farther it slides.
/// Where it turns abruptly, `flanks` takes the tangent planes to both sides: in a hollow they hold as well.
FixedVector<Hollow, 2> hollowsAt(const DistanceField& field, const Pose& X_WB, double dilation,
                                 const Contact& contact, FixedVector<Contact, 4>& flanks) {
  FixedVector<Hollow, 2> hollows;
  const Vector3 p_BP = X_WB.inverse() * contact.p_WP;
  const Vector3 n_B = X_WB.rotation().conjugate() * contact.n_W;
  const double h = kCurveStep * field.voxelAt(p_BP);
  const std::array<Vector3, 2> t = tangentsOf(n_B);
  Eigen::Matrix2d turn;
  for (int side = 0; side < 2; ++side) {
    const Vector3& along = t[static_cast<std::size_t>(side)];
    const FieldSample ahead = field.sample(p_BP + h * along);
    const FieldSample behind = field.sample(p_BP - h * along);
    if (!ahead.exact || !behind.exact) return hollows;
    turn(0, side) = (behind.gradient - ahead.gradient).dot(t[0]);
    turn(1, side) = (behind.gradient - ahead.gradient).dot(t[1]);
    if (turn(side, side) < kSharpTurn) continue;
    for (const double way : {h, -h}) {
      const FieldSample& sample = way > 0.0 ? ahead : behind;
      const double slope = sample.gradient.norm();
      if (slope < kFlankSlope) continue;
      Contact flank = contact;
      flank.gap = (sample.distance - dilation - way * sample.gradient.dot(along)) / slope;
      flank.n_W = X_WB.rotation() * (sample.gradient / slope);
      flank.area = 0.0;
      // elsewhere the surface bulges between here and there
      if (flank.gap >= contact.gap - kFieldNoise) flanks.push_back(flank);
    }
  }
  const double mean = 0.5 * (turn(0, 0) + turn(1, 1));
  const double half = 0.5 * (turn(0, 0) - turn(1, 1));
  const double mixed = 0.5 * (turn(0, 1) + turn(1, 0));
  const double spread = std::sqrt(half * half + mixed * mixed);
  for (const double sign : {1.0, -1.0}) {
    const double value = mean + sign * spread;
    if (value < kLeastTurn) continue;
    // of the two ways to write the eigenvector the longer one
    Vector3 along = half * sign >= 0.0 ? Vector3((spread + sign * half) * t[0] + sign * mixed * t[1])
                                       : Vector3(mixed * t[0] + (sign * spread - half) * t[1]);
    if (spread == 0.0) along = t[sign > 0.0 ? 0 : 1];
    hollows.push_back({X_WB.rotation() * along.normalized(), value / (2.0 * h)});
  }
  return hollows;
}

}  // namespace

bool IslandSolver::findCurves(const Job& job) {
  for (MovableBody& body : job.bodies) {
    body.curves.clear();
    body.drag_Bo_W = Wrench{};
  }
  rows_.resize(listed_);
  curved_.clear();
  flank_count_ = 0;
  bool any = false;
  std::size_t i = 0;
  std::size_t first = 0;
  for (const std::uint32_t row : held_) {
    if (row >= listed_) break;
    curved_.push_back(row);
    while (row >= first + job.results[i].query.contacts.size())
      first += job.results[i++].query.contacts.size();
    const IslandPair& pair = job.pairs[i];
    const Contact& contact = job.results[i].query.contacts[row - first];
    FixedVector<Contact, 4> flanks;
    const auto hollows = hollowsAt(*pair.field_B, job.poseB(pair), pair.dilation, contact, flanks);
    for (const Contact& flank : flanks) {
      if (flank_count_ == flanks_.size()) break;
      flanks_[flank_count_++] = {i, flank};
      rows_.push_back({pair.body_a, pair.body_b, flank.n_W, flank.p_WP, flank.gap});
    }
    for (const Hollow& hollow : hollows) {
      for (const std::int32_t index : {pair.body_a, pair.body_b}) {
        if (index == GapRow::kStatic) continue;
        MovableBody& body = job.bodies[static_cast<std::size_t>(index)];
        const Vector3 arm = contact.p_WP - body.X_WB.translation();
        any |= body.curves.push_back(
            {{hollow.along_W, arm.cross(hollow.along_W)}, multipliers_[row] * hollow.curvature});
      }
    }
  }
  // rows of flanks have other numbers now
  held_.resize(curved_.size());
  return any || flank_count_ > 0;
}

bool IslandSolver::curvesAreOfHeld() const {
  const auto end =
      std::find_if(held_.begin(), held_.end(), [this](std::uint32_t row) { return row >= listed_; });
  return std::equal(held_.begin(), end, curved_.begin(), curved_.end());
}

}  // namespace tenon
