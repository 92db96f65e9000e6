#pragma once

#include <array>
#include <span>
#include <string_view>

#include "idl/types/spatial.h"

/// Where everything in the engine bay is: the one place that parts, pockets, scenario and tests read it from.
///
/// World frame W: x to the trainee's right as the bay is faced, y away from the trainee, z up; the origin
/// lies on the ground in the middle of the bay's front edge. The bay's mesh frame is W. Every part is
/// modelled as it stands when mounted, so its target orientation is the identity; its origin is the place
/// where a person grasps it.
///
/// A part is guided home by tongues: blocks on the part that slide into pockets of the bay. Tongues and
/// pockets are written down in a guide frame G: origin that of the part, insertion along -z_G.
namespace tenon::engine_bay {

/// Free room between a tongue and a wall of its pocket, on each side, when the part is at its target [m].
inline constexpr double kGap = 0.0013;
/// What a scenario calls the clearance of the pair: both sides together.
inline constexpr double kClearance = 2.0 * kGap;
/// Between the tip of a tongue and the floor it sits on, at the target: about what the bay is dilated by.
inline constexpr double kSeatGap = 0.0005;
/// The funnel at a pocket's mouth: so much wider on each side, over the same depth (45 degrees).
inline constexpr double kFunnel = 0.014;
/// From a pocket's mouth down to the tip of a seated tongue.
inline constexpr double kInsertion = 0.055;
inline constexpr double kWall = 0.020;   ///< of a pocket below its funnel; 6 mm are left at the mouth
inline constexpr double kFloor = 0.010;  ///< of a pocket
/// How far before its target a part has a free straight way to it.
inline constexpr double kApproachDistance = 0.30;
/// The bay's outer size, as the paper's Fig. 9 gives it.
inline const Vector3 kBaySize(3.07, 2.36, 1.62);

/// A block of a part that slides into a pocket of the bay; in G.
struct Tongue {
  double x = 0.0, y = 0.0;  ///< its middle
  double width = 0.0;       ///< along x_G
  double depth = 0.0;       ///< along y_G
  double tip = 0.0;         ///< z_G of its end
  double chamfer = 0.004;   ///< of the end, 45 degrees
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
  Vector3 p_PS;               ///< a screw's seat on the part that the drill must be able to reach
  Eigen::AlignedBox3d box_P;  ///< around the whole part

  [[nodiscard]] std::span<const Tongue> usedTongues() const {
    return {tongues.data(), static_cast<std::size_t>(tongue_count)};
  }
};

/// Unit vector along which a part goes in.
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

/// The guide frame in the part's frame.
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

/// Where a part waits, on the right in front of the bay.
inline Pose startPose(const PartLayout&) { return Pose(Vector3(0.95, -0.40, 1.00)); }
inline Pose targetPose(const PartLayout& part) { return Pose(part.p_WT); }

/// The drill: its bit points along +x_D, its handle hangs along -z_D, origin in the grip.
inline const Vector3 kDrillTip(0.215, 0.0, 0.085);
/// From the tip of the bit to the screw's seat at the tool pose: near, not touching.
inline constexpr double kToolGap = 0.012;

/// Where the drill has to be held to show that there is room for it: bit along the approach, just off the
/// screw.
inline Pose toolPose(const PartLayout& part) {
  Matrix3 R_WD = Matrix3::Identity();
  if (part.approach == Approach::kDown) R_WD << 0, -1, 0, 0, 0, 1, -1, 0, 0;
  if (part.approach == Approach::kAway) R_WD << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  if (part.approach == Approach::kRight) R_WD << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  const Vector3 tip = part.p_WT + part.p_PS - kToolGap * approachDirection(part.approach);
  const Quaternion q_WD(R_WD);
  return {tip - q_WD * kDrillTip, q_WD};
}

/// The box round a part's pockets that has to be resolved finely; in W.
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

/// What else is in the scene; `color` is what a display draws it in.
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

}  // namespace tenon::engine_bay
