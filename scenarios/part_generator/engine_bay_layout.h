#pragma once

#include <array>
#include <span>
#include <string_view>

#include "idl/types/spatial.h"

/// Layout of the engine bay: the only source of the poses and sizes that parts, pockets, scenario and tests
/// use.
///
/// World frame W: x to the trainee's right as the bay is faced, y away from the trainee, z up; the origin
/// lies on the ground in the middle of the bay's front edge. The bay's mesh frame is W. Every part is
/// modelled as it stands when mounted, so its target orientation is the identity; its origin is the point
/// where a person grasps it.
///
/// A part is guided to its target by tongues: blocks on the part that slide into pockets of the bay. Tongues
/// and pockets are given in a guide frame G: origin that of the part, insertion along -z_G.
namespace tenon::part_generator::engine_bay {

/// [m] Gap between a tongue and a wall of its pocket, on each side, when the part is at its target.
inline constexpr double kGap = 0.0013;
/// [m] The pair's clearance as scenarios define it: sum of both sides.
inline constexpr double kClearance = 2.0 * kGap;
/// [m] Between the tip of a tongue and the floor of its pocket at the target, within its tolerance.
inline constexpr double kSeatGap = 0.0005;
/// [m] Width of the funnel at a pocket's mouth on each side, equal to its depth (45 degrees).
inline constexpr double kFunnel = 0.014;
/// [m] From a pocket's mouth to the tip of a tongue at the target.
inline constexpr double kInsertion = 0.055;
inline constexpr double kWall =
    0.020;  ///< [m] thickness of a pocket's wall below its funnel; 6 mm at the mouth
inline constexpr double kFloor = 0.010;  ///< [m] thickness of a pocket's floor
/// [m] Length of the collision-free straight approach to a part's target.
inline constexpr double kApproachDistance = 0.30;
/// [m] The bay's outer size (paper Fig. 9).
inline const Vector3 kBaySize(3.07, 2.36, 1.62);

/// A block of a part that slides into a pocket of the bay; in G.
struct Tongue {
  double x = 0.0, y = 0.0;  ///< [m] its centre
  double width = 0.0;       ///< [m] along x_G
  double depth = 0.0;       ///< [m] along y_G
  double tip = 0.0;         ///< [m] z_G of its end
  double chamfer = 0.004;   ///< [m] of the end, 45 degrees
};

enum class Approach { kDown, kAway, kRight };  ///< along -z_W, +y_W, +x_W

struct PartLayout {
  std::string_view name;
  std::string_view title;
  unsigned color = 0;
  Vector3 p_WT;  ///< target position of the part's origin
  Approach approach = Approach::kDown;
  std::array<Tongue, 2> tongues;
  int tongue_count = 1;
  Vector3 p_PS;               ///< seat of the screw that the drill must be able to reach
  Eigen::AlignedBox3d box_P;  ///< a box around the whole part

  [[nodiscard]] std::span<const Tongue> usedTongues() const {
    return {tongues.data(), static_cast<std::size_t>(tongue_count)};
  }
};

/// Unit vector, in W, along which a part is inserted.
inline Vector3 approachDirection(Approach approach) {
  switch (approach) {
    case Approach::kAway:
      return Vector3::UnitY();
    case Approach::kRight:
      return Vector3::UnitX();
    case Approach::kDown:
      break;
  }
  return -Vector3::UnitZ();
}

/// X_PG, the guide frame in the part's frame.
inline Pose guideFrame(Approach approach) {
  Matrix3 R_PG = Matrix3::Identity();
  if (approach == Approach::kAway) R_PG << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  if (approach == Approach::kRight) R_PG << 0, 0, -1, 0, 1, 0, 1, 0, 0;
  return {Vector3::Zero(), Quaternion(R_PG)};
}

inline Eigen::AlignedBox3d boxOf(const Vector3& low, const Vector3& high) { return {low, high}; }

/// The five parts in the order in which they are mounted.
inline const std::array<PartLayout, 5>& parts() {
  static const std::array<PartLayout, 5> kParts{{
      {"control_box",
       "control box",
       0x3A4148,
       {-0.50, 0.72, 0.760},
       Approach::kDown,
       {{{0.0, 0.0, 0.180, 0.120, -0.110, 0.005}, {}}},
       1,
       {0.120, -0.075, 0.046},
       boxOf({-0.160, -0.162, -0.110}, {0.160, 0.112, 0.062})},
      {"covering_board",
       "covering board",
       0x2B2F33,
       {0.0, 0.44, 0.880},
       Approach::kDown,
       {{{-0.110, 0.0, 0.060, 0.030, -0.080, 0.005}, {0.110, 0.0, 0.060, 0.030, -0.080, 0.005}}},
       2,
       {0.270, -0.060, 0.010},
       boxOf({-0.322, -0.122, -0.080}, {0.322, 0.122, 0.040})},
      {"grid",
       "grid",
       0x1F2326,
       {0.0, 0.200, 0.560},
       Approach::kAway,
       {{{-0.110, 0.0, 0.050, 0.036, -0.090, 0.005}, {0.110, 0.0, 0.050, 0.036, -0.090, 0.005}}},
       2,
       {0.245, -0.019, 0.0},
       boxOf({-0.282, -0.040, -0.135}, {0.282, 0.090, 0.135})},
      {"bracket",
       "bracket",
       0xB9A24A,
       {0.640, 0.800, 0.830},
       Approach::kRight,
       {{{-0.075, 0.0, 0.005, 0.070, -0.084, 0.0015}, {0.075, 0.0, 0.005, 0.070, -0.084, 0.0015}}},
       2,
       {0.014, -0.028, 0.0},
       boxOf({-0.070, -0.052, -0.105}, {0.084, 0.052, 0.105})},
      {"wiper_mechanism",
       "wiper mechanism",
       0x6E7C88,
       {0.0, 1.370, 1.020},
       Approach::kDown,
       {{{-0.090, 0.0, 0.050, 0.040, -0.090, 0.005}, {0.090, 0.0, 0.050, 0.040, -0.090, 0.005}}},
       2,
       {-0.150, -0.034, -0.0055},
       boxOf({-0.420, -0.100, -0.090}, {0.420, 0.100, 0.120})},
  }};
  return kParts;
}

/// Start pose X_WP of every part, on the right in front of the bay.
inline Pose startPose(const PartLayout&) { return Pose(Vector3(0.95, -0.40, 1.00)); }
inline Pose targetPose(const PartLayout& part) { return Pose(part.p_WT); }

/// p_DT, tip of the drill's bit. The bit points along +x_D, the handle along -z_D, the origin is in the grip.
inline const Vector3 kDrillTip(0.215, 0.0, 0.085);
/// [m] From the tip of the bit to the screw's seat at the tool pose, so that they do not touch.
inline constexpr double kToolGap = 0.012;

/// X_WD that proves the screw accessible to the drill: bit along the approach, kToolGap before the screw.
inline Pose toolPose(const PartLayout& part) {
  Matrix3 R_WD = Matrix3::Identity();
  if (part.approach == Approach::kDown) R_WD << 0, -1, 0, 0, 0, 1, -1, 0, 0;
  if (part.approach == Approach::kAway) R_WD << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  if (part.approach == Approach::kRight) R_WD << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  const Vector3 tip = part.p_WT + part.p_PS - kToolGap * approachDirection(part.approach);
  const Quaternion q_WD(R_WD);
  return {tip - q_WD * kDrillTip, q_WD};
}

/// The box, in W, round a part's pockets that needs refined voxels.
inline Eigen::AlignedBox3d refineBox(const PartLayout& part) {
  Eigen::AlignedBox3d box;
  const Pose X_WG = targetPose(part) * guideFrame(part.approach);
  for (const Tongue& t : part.usedTongues()) {
    const double wide = kGap + kFunnel + 0.006;
    box.extend(X_WG * Vector3(t.x - 0.5 * t.width - wide, t.y - 0.5 * t.depth - wide, t.tip - 0.006));
    box.extend(X_WG *
               Vector3(t.x + 0.5 * t.width + wide, t.y + 0.5 * t.depth + wide, t.tip + kInsertion + 0.006));
  }
  return box;
}

/// The other objects of the scene.
struct OtherObject {
  std::string_view name;
  std::string_view title;
  unsigned color = 0;
  Pose X_WO;  ///< at the start
};

inline const std::array<OtherObject, 6>& others() {
  static const std::array<OtherObject, 6> kOthers{{
      {"engine_bay", "engine bay", 0xA9B1B8, Pose()},
      {"haptic_pointer", "haptic pointer", 0xE02020, Pose(Vector3(0.30, -0.35, 1.00))},
      {"forearm", "forearm", 0x3FAE49,
       Pose(Vector3(0.30, -0.62, 0.95), Quaternion(0.7071067811865476, 0, 0, 0.7071067811865476))},
      {"drill", "drill", 0xE08A1E,
       Pose(Vector3(-0.45, -0.35, 1.00), Quaternion(0.7071067811865476, 0, 0, 0.7071067811865476))},
      {"assistant", "teaching assistant", 0x2F6FE0, Pose(Vector3(-0.10, -0.30, 1.25))},
      {"head", "head", 0xD9B99B, Pose(Vector3(0.0, -0.85, 1.60))},
  }};
  return kOthers;
}

}  // namespace tenon::part_generator::engine_bay
