#include "scenarios/part_generator/engine_bay_builders.h"
#include "scenarios/part_generator/engine_bay_layout.h"
#include "scenarios/part_generator/hardware.h"

namespace tenon::part_generator::engine_bay {
namespace {

constexpr Color kPocketColor = 0x59636B;

/// A wall of a pocket: its inner face at y = 0 up to the funnel, its length along x, solid towards +y.
void addWall(MeshBuilder& b, double length, double bottom, double mouth) {
  const Polygon section{
      {0.0, bottom}, {kWall, bottom}, {kWall, mouth}, {kFunnel, mouth}, {0.0, mouth - kFunnel}};
  const Pose X_MF = b.frame();
  b.at(X_MF * alongX()).prism(section, {}, -0.5 * length, 0.5 * length);
  b.at(X_MF);
}

/// Four walls and a floor round a tongue. The walls overlap at the corners, which mitres the funnel.
void addPocket(MeshBuilder& b, const Pose& X_WG, const Tongue& tongue) {
  const double half_width = 0.5 * tongue.width + kGap;
  const double half_depth = 0.5 * tongue.depth + kGap;
  const double seat = tongue.tip - kSeatGap;
  const double mouth = tongue.tip + kInsertion;
  const Vector3 middle(tongue.x, tongue.y, 0.0);
  const Quaternion quarter(0.7071067811865476, 0.0, 0.0, 0.7071067811865476);
  Quaternion turn = Quaternion::Identity();
  for (int side = 0; side < 4; ++side) {
    const bool across = side % 2 == 0;
    const double length = 2.0 * ((across ? half_width : half_depth) + kWall);
    b.at(X_WG * Pose(middle, turn) * Pose(Vector3(0.0, across ? half_depth : half_width, 0.0)));
    addWall(b, length, seat - kFloor, mouth);
    turn = (turn * quarter).normalized();
  }
  b.at(X_WG * Pose(middle));
  b.box({-half_width - kWall, -half_depth - kWall, seat - kFloor},
        {half_width + kWall, half_depth + kWall, seat});
}

}  // namespace

void addPockets(MeshBuilder& b) {
  for (const PartLayout& part : parts()) {
    const Pose X_WG = targetPose(part) * guideFrame(part.approach);
    b.paint(kPocketColor);
    for (const Tongue& tongue : part.usedTongues()) addPocket(b, X_WG, tongue);
  }
  b.at(Pose());
  // supports of the pockets
  b.paint(0x6C7780);
  for (const double x : {-0.585, -0.415}) {
    for (const double y : {0.665, 0.775}) {
      b.box({x - 0.014, y - 0.014, 0.44}, {x + 0.014, y + 0.014, 0.642});
      b.box({x - 0.028, y - 0.028, 0.44}, {x + 0.028, y + 0.028, 0.468});
    }
  }
  b.box({-0.600, 0.640, 0.600}, {-0.400, 0.800, 0.612});
  for (const double x : {-0.110, 0.110}) {
    b.box({x - 0.05, 0.415, 0.77}, {x + 0.05, 0.465, 0.792});
    b.box({x - 0.05, 1.345, 0.90}, {x + 0.05, 1.395, 0.921});
  }
  b.box({-0.30, 0.2970, 0.525}, {0.30, 0.335, 0.595});
  for (const double x : {-0.27, 0.27}) b.box({x - 0.02, 0.300, 0.30}, {x + 0.02, 0.332, 0.76});
  for (const double z : {0.755, 0.905}) b.box({0.731, 0.755, z - 0.03}, {0.741, 0.845, z + 0.03});
}

}  // namespace tenon::part_generator::engine_bay
