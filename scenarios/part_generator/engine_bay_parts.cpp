#include <array>

#include "scenarios/part_generator/engine_bay_builders.h"
#include "scenarios/part_generator/engine_bay_layout.h"
#include "scenarios/part_generator/hardware.h"

namespace tenon::part_generator::engine_bay {
namespace {

const PartLayout& layoutOf(std::string_view name) {
  for (const PartLayout& part : parts()) {
    if (part.name == name) return part;
  }
  return parts().front();
}

/// The blocks that slide into the bay's pockets, up to `root` (z_G) inside the part's body.
void addTongues(MeshBuilder& b, const PartLayout& part, double root) {
  b.at(guideFrame(part.approach));
  for (const Tongue& t : part.usedTongues()) {
    b.chamferedTongue({t.x - 0.5 * t.width, t.y - 0.5 * t.depth, t.tip},
                      {t.x + 0.5 * t.width, t.y + 0.5 * t.depth, root}, t.chamfer);
  }
  b.at(Pose());
}

}  // namespace

PartMesh makeControlBox(double detail) {
  MeshBuilder b(detail);
  const PartLayout& part = layoutOf("control_box");
  b.paint(0x50595F);
  addTongues(b, part, -0.040);
  // the cast housing, its flange and the ears of its lid
  b.paint(0x8E989E).roundBox({-0.140, -0.095, -0.045}, {0.140, 0.095, 0.026}, 0.010);
  b.paint(0x7C868C).roundBox({-0.146, -0.101, 0.014}, {0.146, 0.101, 0.024}, 0.004);
  b.paint(0x9BA5AB).roundBox({-0.138, -0.093, 0.018}, {0.138, 0.093, 0.038}, 0.007);
  for (int i = 0; i < 17; ++i) {
    const double x = -0.088 + 0.011 * i;
    b.roundBox({x - 0.0022, -0.082, 0.030}, {x + 0.0022, 0.082, 0.060}, 0.0021);
  }
  for (const double side : {-1.0, 1.0}) {
    for (int i = 0; i < 9; ++i) {
      const double x = -0.112 + 0.028 * i;
      b.roundBox({x - 0.003, side * 0.097 - 0.010, -0.040}, {x + 0.003, side * 0.097 + 0.010, 0.018}, 0.0028);
    }
  }
  for (const double x : {-0.120, 0.120}) {
    for (const double y : {-0.075, 0.075}) {
      b.paint(0x9BA5AB);
      addBoss(b, {x, y, 0.030}, Vector3::UnitZ(), 0.011, 0.0035, 0.016);
    }
    b.paint(0xB4BABF);
    addHexBolt(b, {x, 0.0, 0.038}, Vector3::UnitZ(), 0.006);
  }
  // plugs on the right, a vent and the earth strap on the left
  for (int i = 0; i < 3; ++i) {
    addConnector(b, {0.090 - 0.062 * i, -0.101, -0.010}, -Vector3::UnitY(), {0.046, 0.024}, 6,
                 i == 1 ? 0xD9D4C5 : 0x2C3D66);
  }
  b.paint(0x2A2E31).cylinder({-0.138, 0.045, -0.005}, {-0.151, 0.045, -0.005}, 0.011, 0.002);
  b.cylinder({-0.148, 0.045, -0.005}, {-0.156, 0.045, -0.005}, 0.007, 0.001);
  b.paint(0xE9EBEC).box({-0.1365, -0.030, 0.0375}, {-0.1000, 0.030, 0.0384});
  return b.take();
}

PartMesh makeCoveringBoard(double detail) {
  MeshBuilder b(detail);
  const PartLayout& part = layoutOf("covering_board");
  b.paint(0x24282B);
  addTongues(b, part, 0.0);
  // the board, holes for its clips, a rim bent down in front
  std::vector<Polygon> holes;
  const int n = b.segments(0.006);
  for (const double x : {-0.270, 0.270}) {
    for (const double y : {-0.060, 0.060}) holes.push_back(circle({x, y}, 0.0060, n));
  }
  for (int i = -2; i <= 2; ++i)
    holes.push_back(roundedRectangle({0.085 * i, 0.085}, {0.050, 0.012}, 0.005, b.steps(2, 8)));
  b.paint(0x33393E).prism(roundedRectangle(Vector2::Zero(), {0.640, 0.240}, 0.030, b.steps(4, 24)), holes,
                          -0.006, 0.0);
  const Polygon rim{{-0.120, -0.003},  {-0.116, -0.0015}, {-0.110, -0.0060},
                    {-0.116, -0.0120}, {-0.119, -0.0140}, {-0.122, -0.0120}};
  b.at(alongX()).prism(rim, {}, -0.285, 0.285);
  b.at(Pose());
  // stiffening ribs in both directions and a raised field in the middle
  for (int i = -6; i <= 6; ++i) {
    if (i == 0) continue;
    b.roundBox({0.040 * i - 0.002, -0.105, -0.003}, {0.040 * i + 0.002, 0.068, 0.008}, 0.0018);
  }
  for (const double y : {-0.095, -0.030, 0.030, 0.064})
    b.roundBox({-0.300, y - 0.002, -0.003}, {0.300, y + 0.002, 0.010}, 0.0018);
  b.paint(0x3D444A).roundBox({-0.105, -0.052, -0.004}, {0.105, 0.052, 0.014}, 0.010);
  b.paint(0xC9CED2).roundBox({-0.050, -0.016, 0.010}, {0.050, 0.016, 0.0155}, 0.0025);
  for (const double x : {-0.270, 0.270}) {
    for (const double y : {-0.060, 0.060}) {
      b.paint(0x33393E);
      addBoss(b, {x, y, -0.003}, Vector3::UnitZ(), 0.012, 0.004, 0.013);
    }
    // spreading clips
    b.paint(0xD8C690);
    for (const double y : {-0.100, 0.095}) {
      b.cylinder({x * 0.75, y, -0.012}, {x * 0.75, y, 0.004}, 0.006, 0.001);
      b.cylinder({x * 0.75, y, 0.0}, {x * 0.75, y, 0.005}, 0.010, 0.002);
    }
  }
  // a grip to hold it by
  b.paint(0x24282B);
  b.pipe(std::array{Vector3(-0.075, 0.0, 0.008), Vector3(-0.075, 0.0, 0.034), Vector3(0.075, 0.0, 0.034),
                    Vector3(0.075, 0.0, 0.008)},
         0.0055, 0.018);
  return b.take();
}

PartMesh makeGrid(double detail) {
  MeshBuilder b(detail);
  const PartLayout& part = layoutOf("grid");
  b.paint(0x2B3034);
  addTongues(b, part, 0.005);
  b.at(alongY());
  // frame: outline with the window cut out, polygon of (z, x)
  const int n = b.steps(4, 24);
  const std::array<Polygon, 1> window{roundedRectangle(Vector2::Zero(), {0.200, 0.460}, 0.022, n)};
  b.paint(0x2F3539).prism(roundedRectangle(Vector2::Zero(), {0.268, 0.560}, 0.040, n), window, -0.019, 0.010);
  const std::array<Polygon, 1> lip{roundedRectangle(Vector2::Zero(), {0.208, 0.468}, 0.024, n)};
  b.paint(0xB9C0C5).prism(roundedRectangle(Vector2::Zero(), {0.222, 0.482}, 0.028, n), lip, -0.026, -0.012);
  b.at(Pose());
  // bars: horizontal ones rounded and tilted, vertical ones behind them
  b.paint(0x1F2427);
  for (int i = -4; i <= 4; ++i) {
    const double z = 0.0225 * i;
    b.at(Pose(Vector3(0.0, -0.006, z), expRotation(Vector3(0.35, 0.0, 0.0))));
    b.roundBox({-0.236, -0.014, -0.0032}, {0.236, 0.014, 0.0032}, 0.003);
  }
  b.at(Pose());
  for (int i = -5; i <= 5; ++i)
    b.roundBox({0.042 * i - 0.0025, -0.004, -0.105}, {0.042 * i + 0.0025, 0.012, 0.105}, 0.0022);
  // the block behind the bars that carries the tongues
  b.paint(0x2B3034).box({-0.150, 0.004, -0.024}, {0.150, 0.018, 0.024});
  b.box({-0.245, 0.004, -0.010}, {0.245, 0.012, 0.010});
  // emblem
  b.paint(0xC9CED2);
  b.torus({0.0, -0.022, 0.0}, Vector3::UnitY(), 0.036, 0.005);
  b.roundBox({-0.034, -0.026, -0.004}, {0.034, -0.018, 0.004}, 0.003);
  b.roundBox({-0.004, -0.026, -0.034}, {0.004, -0.018, 0.034}, 0.003);
  b.paint(0x596168);
  for (const double x : {-0.255, 0.255}) {
    for (const double z : {-0.095, 0.095}) addHexBolt(b, {x, -0.019, z}, -Vector3::UnitY(), 0.006);
    b.tube({x * 0.961, -0.0190, 0.0}, {x * 0.961, -0.0150, 0.0}, 0.009, 0.004);
  }
  return b.take();
}

PartMesh makeBracket(double detail) {
  MeshBuilder b(detail);
  const PartLayout& part = layoutOf("bracket");
  const Color zinc = 0xC7B25A;
  b.paint(zinc);
  addTongues(b, part, -0.0145);
  // base: a 5 mm sheet in the plane of y and z with lightening holes
  std::vector<Polygon> holes;
  for (const double z : {-0.052, 0.052}) holes.push_back(circle({0.016, z}, 0.015, b.segments(0.02)));
  holes.push_back(circle({-0.028, 0.0}, 0.0045, b.segments(0.006)));
  holes.push_back(roundedRectangle({0.012, 0.0}, {0.012, 0.040}, 0.0055, b.steps(3, 16)));
  b.at(alongX());
  b.prism(roundedRectangle(Vector2(0.0, 0.0), {0.090, 0.190}, 0.016, b.steps(4, 24)), holes, 0.014, 0.019);
  b.at(Pose());
  // the two legs turn into the base with a bend
  for (const double side : {-1.0, 1.0}) {
    b.at(alongY());
    Polygon bend;
    const int n = b.steps(4, 24);
    for (int i = 0; i <= n; ++i) {
      const Vector2 d = direction(0.5 * kPi * i / n);
      bend.emplace_back(side * (0.0685 + 0.0090 * d.y()), 0.0230 - 0.0090 * d.x());
    }
    for (int i = n; i >= 0; --i) {
      const Vector2 d = direction(0.5 * kPi * i / n);
      bend.emplace_back(side * (0.0685 + 0.0040 * d.y()), 0.0230 - 0.0040 * d.x());
    }
    b.prism(bend, {}, -0.035, 0.035);
    b.at(Pose());
  }
  // the arm: bent back along the far edge, with a slot and two studs
  const std::array<Polygon, 2> arm_holes{
      roundedRectangle({-0.030, 0.0}, {0.014, 0.050}, 0.006, b.steps(3, 16)),
      circle({-0.052, 0.062}, 0.005, b.segments(0.006))};
  const Pose arm(Vector3(0.0, 0.045, 0.0), Quaternion(0.7071067811865476, 0.7071067811865476, 0.0, 0.0));
  b.at(arm).prism(roundedRectangle({-0.0245, 0.0}, {0.085, 0.150}, 0.014, b.steps(4, 24)), arm_holes, -0.005,
                  0.0);
  b.at(Pose());
  for (const double z : {-0.060, 0.060}) {
    // gussets stiffen the bend
    const Polygon gusset{{0.014, 0.041}, {0.014, 0.012}, {-0.040, 0.041}};
    b.prism(gusset, {}, z - 0.002, z + 0.002);
  }
  b.paint(0xB4BABF);
  for (const double z : {-0.035, 0.040}) addHexBolt(b, {-0.055, 0.042, z}, -Vector3::UnitY(), 0.008);
  b.tube({0.0140, -0.028, 0.0}, {0.0148, -0.028, 0.0}, 0.010, 0.0045);
  b.paint(zinc).roundBox({-0.012, 0.010, -0.004}, {0.016, 0.044, 0.004}, 0.003);
  return b.take();
}

PartMesh makeWiperMechanism(double detail) {
  MeshBuilder b(detail);
  const PartLayout& part = layoutOf("wiper_mechanism");
  b.paint(0x59636B);
  addTongues(b, part, -0.020);
  // carrier plate and the tube that connects the two pivots
  std::vector<Polygon> holes;
  for (const double x : {-0.150, 0.150}) holes.push_back(circle({x, -0.034}, 0.0045, b.segments(0.006)));
  for (const double x : {-0.045, 0.045}) holes.push_back(circle({x, 0.0}, 0.016, b.segments(0.02)));
  b.paint(0x7E8A92).prism(roundedRectangle(Vector2::Zero(), {0.350, 0.110}, 0.020, b.steps(4, 24)), holes,
                          -0.025, -0.017);
  b.paint(0x8D979E);
  b.pipe(std::array{Vector3(-0.380, 0.0, 0.010), Vector3(-0.260, 0.0, 0.000), Vector3(0.260, 0.0, 0.000),
                    Vector3(0.380, 0.0, 0.010)},
         0.012, 0.08);
  for (const double x : {-0.150, 0.150}) {
    b.box({x - 0.012, -0.016, -0.020}, {x + 0.012, 0.016, 0.0});
    addBoss(b, {x, -0.034, -0.0175}, Vector3::UnitZ(), 0.010, 0.0045, 0.012);
  }
  for (const double x : {-0.380, 0.380}) {
    // pivot housing, shaft, knurled cone and nut, and the arm below that the rod moves
    const std::array<Vector2, 6> housing{Vector2(0.0, -0.020),  Vector2(0.022, -0.020), Vector2(0.024, 0.0),
                                         Vector2(0.018, 0.050), Vector2(0.015, 0.062),  Vector2(0.0, 0.062)};
    b.paint(0x7E8A92).lathe({x, 0, 0}, Vector3::UnitZ(), housing);
    b.paint(0xC4C9CD).cylinder({x, 0, 0.05}, {x, 0, 0.108}, 0.007, 0.001);
    b.cone({x, 0, 0.070}, {x, 0, 0.092}, 0.010, 0.0075);
    b.prism(circle({x, 0.0}, 0.011, 6), {}, 0.094, 0.104);
    b.paint(0xB4BABF).prism(roundedRectangle({x, 0.030}, {0.024, 0.084}, 0.0118, b.steps(3, 16)), {}, 0.0630,
                            0.0680);
    b.sphere({x, 0.060, 0.060}, 0.008);
  }
  // motor with gear housing behind the tube, its crank and the two rods
  b.paint(0x3A4046).cylinder({0.075, 0.050, 0.012}, {0.195, 0.050, 0.012}, 0.032, 0.004);
  b.tube({0.095, 0.050, 0.012}, {0.103, 0.050, 0.012}, 0.0335, 0.030);
  b.tube({0.165, 0.050, 0.012}, {0.173, 0.050, 0.012}, 0.0335, 0.030);
  b.paint(0x9AA3A8).cylinder({0.030, 0.050, -0.018}, {0.030, 0.050, 0.034}, 0.044, 0.005);
  b.roundBox({0.040, 0.026, -0.010}, {0.092, 0.074, 0.032}, 0.008);
  for (int i = 0; i < 5; ++i) {
    const Vector2 d = direction(2.0 * kPi * i / 5.0 + 0.3);
    addHexBolt(b, {0.030 + 0.037 * d.x(), 0.050 + 0.037 * d.y(), 0.034}, Vector3::UnitZ(), 0.005);
  }
  b.paint(0xC4C9CD).cylinder({0.030, 0.050, 0.03}, {0.030, 0.050, 0.056}, 0.008, 0.001);
  b.paint(0xB4BABF).prism(roundedRectangle({0.010, 0.050}, {0.062, 0.022}, 0.0108, b.steps(3, 16)), {}, 0.046,
                          0.052);
  b.sphere({-0.012, 0.050, 0.058}, 0.008);
  b.paint(0x4A525A);
  b.pipe(std::array{Vector3(-0.012, 0.050, 0.060), Vector3(-0.380, 0.060, 0.060)}, 0.006, 0.0);
  b.pipe(std::array{Vector3(-0.012, 0.050, 0.068), Vector3(0.380, 0.060, 0.060)}, 0.006, 0.0);
  addConnector(b, {0.195, 0.050, 0.012}, Vector3::UnitX(), {0.026, 0.018}, 4, 0x2C3D66);
  return b.take();
}

}  // namespace tenon::part_generator::engine_bay
