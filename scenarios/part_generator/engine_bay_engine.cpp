#include <array>

#include "scenarios/part_generator/engine_bay_builders.h"
#include "scenarios/part_generator/hardware.h"

namespace tenon::part_generator::engine_bay {
namespace {

constexpr Color kCast = 0xA7AEB3;
constexpr Color kDark = 0x343A3F;
constexpr Color kSteel = 0xC0C6CA;
constexpr double kFirstCylinder = -0.195;
constexpr double kBore = 0.105;

void addBlock(MeshBuilder& b) {
  b.paint(kCast).roundBox({-0.27, 0.76, 0.28}, {0.21, 1.10, 0.545}, 0.015);
  b.paint(0x6D757B).roundBox({-0.24, 0.78, 0.17}, {0.18, 1.08, 0.285}, 0.030);
  b.paint(kCast);
  for (int i = 0; i < 9; ++i) {
    const double x = -0.24 + 0.0525 * i;
    b.roundBox({x - 0.004, 0.745, 0.29}, {x + 0.004, 0.77, 0.53}, 0.0035);
    b.roundBox({x - 0.004, 1.09, 0.29}, {x + 0.004, 1.112, 0.53}, 0.0035);
  }
  for (const double z : {0.35, 0.42, 0.49})
    b.roundBox({-0.26, 0.748, z - 0.004}, {0.20, 0.768, z + 0.004}, 0.0035);
  b.paint(kSteel);
  for (const double y : {0.752, 1.105}) {
    const Vector3 out(0.0, y < 0.9 ? -1.0 : 1.0, 0.0);
    addBoltRow(b, {-0.25, y, 0.29}, {0.19, y, 0.29}, 10, out, 0.008);
  }
  // cylinder head and the ribbed cover with coils, cap and bolts
  b.paint(0xB4BABF).roundBox({-0.265, 0.80, 0.535}, {0.205, 1.06, 0.600}, 0.008);
  b.paint(kDark).roundBox({-0.255, 0.815, 0.590}, {0.195, 1.045, 0.642}, 0.018);
  for (int i = 0; i < 8; ++i) {
    const double y = 0.835 + 0.012 * i;
    b.roundBox({-0.235, y - 0.0025, 0.63}, {0.080, y + 0.0025, 0.6495}, 0.0023);
  }
  b.paint(0xB8322A).roundBox({-0.215, 0.965, 0.63}, {0.155, 1.010, 0.648}, 0.010);
  b.paint(kDark);
  for (int i = 0; i < 4; ++i) {
    const double x = kFirstCylinder + kBore * i + 0.005;
    b.cylinder({x, 0.9875, 0.63}, {x, 0.9875, 0.655}, 0.017, 0.003);
    addConnector(b, {x, 1.004, 0.645}, Vector3::UnitY(), {0.020, 0.012}, 3, 0x2B2F33);
  }
  b.paint(0xE2B23A).cylinder({0.140, 0.875, 0.63}, {0.140, 0.875, 0.659}, 0.026, 0.004);
  b.paint(kSteel);
  addBoltRow(b, {-0.245, 0.825, 0.640}, {0.185, 0.825, 0.640}, 7, Vector3::UnitZ(), 0.007);
  addBoltRow(b, {-0.245, 1.036, 0.640}, {0.185, 1.036, 0.640}, 7, Vector3::UnitZ(), 0.007);
}

void addIntake(MeshBuilder& b) {
  b.paint(0x4A5157).cylinder({-0.255, 0.645, 0.545}, {0.165, 0.645, 0.545}, 0.050, 0.012);
  for (int i = 0; i < 12; ++i)
    b.tube({-0.235 + 0.034 * i, 0.645, 0.545}, {-0.231 + 0.034 * i, 0.645, 0.545}, 0.0535, 0.049);
  for (int i = 0; i < 4; ++i) {
    const double x = kFirstCylinder + kBore * i;
    b.paint(0x4A5157).pipe(
        std::array{Vector3(x, 0.645, 0.49), Vector3(x, 0.645, 0.43), Vector3(x, 0.715, 0.43),
                   Vector3(x, 0.725, 0.565), Vector3(x, 0.81, 0.575)},
        0.022, 0.05);
    b.tube({x, 0.790, 0.5735}, {x, 0.806, 0.5745}, 0.034, 0.020);
    b.paint(kSteel);
    for (const double side : {-0.028, 0.028})
      addHexBolt(b, {x + side, 0.790, 0.574}, -Vector3::UnitY(), 0.007);
    b.paint(0x2C3D66).cylinder({x, 0.765, 0.600}, {x, 0.790, 0.585}, 0.008);
  }
  b.paint(0xC0C6CA).pipe(std::array{Vector3(-0.23, 0.765, 0.606), Vector3(0.15, 0.765, 0.606)}, 0.008, 0.0);
  // throttle body
  b.paint(kCast).cylinder({0.160, 0.645, 0.545}, {0.225, 0.645, 0.545}, 0.040, 0.003);
  b.roundBox({0.170, 0.590, 0.515}, {0.212, 0.620, 0.590}, 0.006);
}

void addExhaust(MeshBuilder& b) {
  b.paint(0x8A7B6D);
  for (int i = 0; i < 4; ++i) {
    const double x = kFirstCylinder + kBore * i;
    b.pipe(std::array{Vector3(x, 1.05, 0.565), Vector3(x, 1.145, 0.565),
                      Vector3(-0.06 + 0.25 * (x + 0.03), 1.185, 0.44), Vector3(-0.04, 1.19, 0.34)},
           0.019, 0.06);
    b.tube({x, 1.055, 0.565}, {x, 1.068, 0.565}, 0.033, 0.018);
  }
  b.cylinder({-0.04, 1.19, 0.36}, {-0.04, 1.20, 0.24}, 0.050, 0.010);
  b.pipe(std::array{Vector3(-0.04, 1.20, 0.25), Vector3(-0.04, 1.22, 0.16), Vector3(-0.04, 2.20, 0.14)},
         0.028, 0.08);
  // heat shield: a bare sheet
  b.paint(0xC9CDCF).sheet(b.steps(24, 160), b.steps(8, 64), [](double u, double v) {
    const Vector2 d = direction(0.5 * kPi * v);
    const double bead = (static_cast<int>(u * 12.0) % 2 == 0) ? 0.003 : 0.0;
    return Vector3(-0.24 + 0.40 * u, 1.12 + (0.085 + bead) * d.y(), 0.535 + (0.070 + bead) * d.x());
  });
}

void addBeltDrive(MeshBuilder& b) {
  const Vector3 x = Vector3::UnitX();
  b.paint(0x596168).roundBox({0.20, 0.79, 0.30}, {0.235, 1.07, 0.60}, 0.012);
  const std::array<Vector2, 3> centres{Vector2(0.94, 0.34), Vector2(0.70, 0.43), Vector2(0.93, 0.52)};
  const std::array radii{0.070, 0.036, 0.055};
  for (std::size_t i = 0; i < centres.size(); ++i) {
    b.paint(0x7E878D);
    addPulley(b, {0.262, centres[i].x(), centres[i].y()}, x, radii[i], 0.026);
  }
  // the belt: flat pieces between the pulleys' rims, seen as a thin band
  b.paint(0x1C1E20);
  const auto strand = [&](const Vector2& from, const Vector2& to) {
    const Vector2 along = (to - from).normalized();
    const Vector2 across(-0.002 * along.y(), 0.002 * along.x());
    b.at(alongX()).prism({from - across, to - across, to + across, from + across}, {}, 0.250, 0.274);
    b.at(Pose());
  };
  strand({0.915, 0.273}, {0.688, 0.396});
  strand({0.686, 0.464}, {0.915, 0.573});
  strand({0.985, 0.520}, {1.010, 0.345});
  // alternator with its ribs and slots
  b.paint(0xB4BABF).cylinder({0.080, 0.70, 0.43}, {0.245, 0.70, 0.43}, 0.066, 0.010);
  for (int i = 0; i < 18; ++i) {
    const Vector2 d = direction(2.0 * kPi * i / 18.0);
    const Vector3 at(0.0, 0.70 + 0.064 * d.x(), 0.43 + 0.064 * d.y());
    b.roundBox(at + Vector3(0.095, -0.003, -0.003), at + Vector3(0.230, 0.003, 0.003), 0.0025);
  }
  b.paint(kDark).cylinder({0.060, 0.70, 0.43}, {0.085, 0.70, 0.43}, 0.045, 0.006);
}

void addGearbox(MeshBuilder& b) {
  const Vector3 out = -Vector3::UnitX();
  const std::array<Vector2, 8> bell{Vector2(0.0, 0.0),     Vector2(0.150, 0.0),   Vector2(0.150, 0.018),
                                    Vector2(0.135, 0.028), Vector2(0.105, 0.110), Vector2(0.090, 0.190),
                                    Vector2(0.070, 0.200), Vector2(0.0, 0.200)};
  b.paint(kCast).lathe({-0.265, 0.93, 0.37}, out, bell);
  for (int i = 0; i < 14; ++i) {
    const Vector2 d = direction(2.0 * kPi * i / 14.0);
    b.paint(kSteel);
    addHexBolt(b, {-0.283, 0.93 + 0.141 * d.x(), 0.37 + 0.141 * d.y()}, out, 0.008);
    b.paint(kCast);
    const Pose frame(Vector3(-0.30, 0.93, 0.37), expRotation(Vector3(2.0 * kPi * i / 14.0 - kPi, 0.0, 0.0)));
    b.at(frame).roundBox({-0.150, 0.080, -0.003}, {0.010, 0.118, 0.003}, 0.0025);
    b.at(Pose());
  }
  b.roundBox({-0.40, 0.98, 0.28}, {-0.28, 1.16, 0.42}, 0.03);
  for (const double side : {-1.0, 1.0}) {
    b.paint(0x4A5157).cylinder({side * 0.30, 1.10, 0.33}, {side * 0.74, 1.00, 0.315}, 0.014);
    const double root = side * 0.42;
    b.paint(0x24272A).hose(std::array{Vector3(root, 1.073, 0.327), Vector3(root + side * 0.10, 1.050, 0.324)},
                           0.042, 0.0, 0.018, 0.010);
  }
}

}  // namespace

void addEngine(MeshBuilder& b) {
  addBlock(b);
  addIntake(b);
  addExhaust(b);
  addBeltDrive(b);
  addGearbox(b);
}

}  // namespace tenon::part_generator::engine_bay
