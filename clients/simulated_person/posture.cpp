#include "clients/simulated_person/posture.h"

#include <algorithm>
#include <cmath>

namespace tenon::simulated_person {

namespace {
// An adult's dimensions [assumed]; the workspace centre is in front of the chest.
constexpr double kUpperArm = 0.30;  // [m]
constexpr double kForearm = 0.26;   // [m] elbow to wrist
constexpr double kPalm = 0.07;      // [m] wrist to grip
constexpr double kGazeTime = 0.25;  // [s] time constant of the gaze

Quaternion fromAxes(const Vector3& x, const Vector3& y, const Vector3& z) {
  Matrix3 R;
  R.col(0) = x;
  R.col(1) = y;
  R.col(2) = z;
  return Quaternion(R).normalized();
}
}  // namespace

void Posture::step(const Pose& X_WH, const Vector3& p_WC, double dt) noexcept {
  const Vector3 p_WShoulder = p_WC + Vector3(0.10 * side_, -0.38, 0.22);
  const Vector3 to_hand = X_WH.translation() - p_WShoulder;
  const double distance = std::max(0.05, to_hand.norm());
  const Vector3 along = to_hand / distance;

  // the elbow is at the lowest point of a circle about the line from shoulder to wrist, tilted outwards
  const double reach = std::clamp(distance - kPalm, 0.08, kUpperArm + kForearm - 0.005);
  const double foot = (reach * reach + kUpperArm * kUpperArm - kForearm * kForearm) / (2.0 * reach);
  const double height = std::sqrt(std::max(0.0, kUpperArm * kUpperArm - foot * foot));
  const Vector3 down(0.35 * side_, 0.0, -1.0);
  Vector3 out = down - down.dot(along) * along;
  out = out.norm() > 1e-6 ? out.normalized() : Vector3(side_, 0.0, 0.0);
  const Vector3 p_WElbow = p_WShoulder + foot * along + height * out;
  const Vector3 p_WWrist = X_WH.translation() - kPalm * along;

  const Vector3 x = (p_WWrist - p_WElbow).normalized();
  const Vector3 up = std::abs(x.z()) < 0.99 ? Vector3(Vector3::UnitZ()) : Vector3(-Vector3::UnitY());
  const Vector3 y = up.cross(x).normalized();
  // beyond the arm's length the wrist stays at the hand, so the elbow is a forearm's length behind it
  X_WF_ = {p_WWrist - kForearm * x, fromAxes(x, y, x.cross(y))};

  if (gaze_W_.isZero(0.0)) gaze_W_ = X_WH.translation();
  gaze_W_ += dt / (kGazeTime + dt) * (X_WH.translation() - gaze_W_);
  const Vector3 p_WEyes = p_WC + Vector3(0.0, -0.50, 0.50);
  const Vector3 gaze = (gaze_W_ - p_WEyes).normalized();
  const Vector3 right = gaze.cross(Vector3::UnitZ()).normalized();
  X_WE_ = {p_WEyes, fromAxes(right, gaze, right.cross(gaze))};
}

}  // namespace tenon::simulated_person
