#include <array>

#include "scenarios/part_generator/engine_bay_builders.h"
#include "scenarios/part_generator/hardware.h"

namespace tenon::part_generator::engine_bay {
namespace {

constexpr Color kPaint = 0x1F5F78;
constexpr Color kRubber = 0x24272A;
constexpr double kWheelY = 0.95;
constexpr double kWheelRadius = 0.315;

double smoothStep(double t) { return t * t * (3.0 - 2.0 * t); }

void addWheel(MeshBuilder& b, double side) {
  const Vector3 hub(side * 0.775, kWheelY, kWheelRadius);
  const Vector3 out(side, 0.0, 0.0);
  std::vector<Vector2> tyre{{0.205, 0.010}, {0.250, 0.0}, {0.290, 0.006}, {0.308, 0.022}};
  for (int groove = 0; groove < 4; ++groove) {
    const double z = 0.030 + 0.027 * groove;
    tyre.insert(tyre.end(), {{0.315, z}, {0.315, z + 0.018}, {0.307, z + 0.020}, {0.307, z + 0.025}});
  }
  tyre.insert(tyre.end(), {{0.308, 0.140}, {0.290, 0.156}, {0.250, 0.162}, {0.205, 0.152}, {0.205, 0.010}});
  b.paint(kRubber).lathe(hub, out, tyre);
  const std::array<Vector2, 8> rim{Vector2(0.206, 0.015), Vector2(0.206, 0.150), Vector2(0.198, 0.152),
                                   Vector2(0.190, 0.140), Vector2(0.185, 0.090), Vector2(0.185, 0.020),
                                   Vector2(0.190, 0.015), Vector2(0.206, 0.015)};
  b.paint(0xB9C0C6).lathe(hub, out, rim);
  const Quaternion q = zTo(out);
  for (int i = 0; i < 10; ++i) {
    const Quaternion turn = expRotation(Vector3(0.0, 0.0, 0.2 * kPi * i - kPi));
    b.at(Pose(hub, (q * turn).normalized())).roundBox({0.04, -0.013, 0.118}, {0.195, 0.013, 0.140}, 0.007);
  }
  b.at(Pose());
  b.cylinder(hub + 0.06 * out, hub + 0.146 * out, 0.055, 0.008);
  b.paint(0x6F777D).tube(hub + 0.03 * out, hub + 0.045 * out, 0.150, 0.060);
  b.paint(0x8D969C);
  for (int i = 0; i < 5; ++i) {
    const Vector2 d = direction(0.4 * kPi * i);
    addHexBolt(b, hub + 0.146 * out + q * Vector3(0.036 * d.x(), 0.036 * d.y(), 0.0), out, 0.012);
  }
  b.paint(0x3A4046).cylinder(hub - 0.2 * out, hub + 0.02 * out, 0.035);
}

/// The outer panel: a sheet without thickness whose lower edge follows the wheel arch.
void addFender(MeshBuilder& b, double side) {
  b.paint(kPaint).sheet(b.steps(40, 260), b.steps(12, 60), [&](double u, double v) {
    const double y = 0.10 + 1.52 * u;
    const double dy = y - kWheelY;
    const double arch = 0.365;
    double low = 0.24;
    if (std::abs(dy) < arch) low = std::max(low, kWheelRadius + std::sqrt(arch * arch - dy * dy));
    const double top = 0.90 + 0.04 * smoothStep(u);
    const double z = low + (top - low) * v;
    // bulged over the wheel, drawn in towards the nose
    const double nose = u < 0.28 ? 1.0 - u / 0.28 : 0.0;
    const double bulge = 0.055 * (1.0 - (z - 0.60) * (z - 0.60) / 0.16);
    const double x = 0.905 + bulge - 0.22 * nose * nose;
    return Vector3(side * x, y, z);
  });
  // the flange at the top, turned inwards
  b.sheet(b.steps(40, 260), b.steps(2, 8), [&](double u, double v) {
    const double nose = u < 0.28 ? 1.0 - u / 0.28 : 0.0;
    const double z = 0.90 + 0.04 * smoothStep(u);
    const double edge = 0.905 + 0.055 * (1.0 - (z - 0.60) * (z - 0.60) / 0.16) - 0.22 * nose * nose;
    const double inner = std::min(edge - 0.01, 0.80);
    return Vector3(side * (edge + (inner - edge) * v), 0.10 + 1.52 * u, z - 0.012 * v * v);
  });
  b.paint(kRubber);
  std::vector<Vector3> lip;
  const int n = b.steps(16, 120);
  for (int i = 0; i <= n; ++i) {
    const Vector2 d = direction(kPi * (0.02 + 0.96 * i / n));
    lip.emplace_back(side * 0.945, kWheelY - 0.372 * d.x(), kWheelRadius + 0.372 * d.y());
  }
  b.pipe(lip, 0.010, 0.0);
}

void addLamp(MeshBuilder& b, double side) {
  const Vector3 middle(side * 0.60, 0.20, 0.64);
  b.paint(0x3A4046).roundBox(middle - Vector3(0.155, 0.04, 0.085), middle + Vector3(0.125, 0.11, 0.085),
                             0.03);
  for (const double x : {-0.065, 0.045}) {
    const std::array<Vector2, 7> reflector{
        Vector2(0.0, 0.0),     Vector2(0.020, 0.0), Vector2(0.048, 0.020), Vector2(0.058, 0.045),
        Vector2(0.061, 0.045), Vector2(0.061, 0.0), Vector2(0.061, -0.004)};
    b.paint(0xD5DADD).lathe(middle + Vector3(side * x, -0.02, 0.0), -Vector3::UnitY(), reflector, false);
    b.paint(0xF2EFD8).sphere(middle + Vector3(side * x, -0.035, 0.0), 0.024);
    b.paint(0xAEB6BB).torus(middle + Vector3(side * x, -0.062, 0.0), Vector3::UnitY(), 0.060, 0.005);
  }
  b.paint(0xE08A1E).roundBox(middle + Vector3(side > 0 ? 0.085 : -0.125, -0.05, -0.06),
                             middle + Vector3(side > 0 ? 0.125 : -0.085, 0.0, 0.06), 0.012);
}

void addCabin(MeshBuilder& b) {
  for (const double side : {-1.0, 1.0}) {
    b.paint(kPaint);
    b.pipe(std::array{Vector3(side * 0.80, 1.50, 0.86), Vector3(side * 0.76, 1.66, 1.02),
                      Vector3(side * 0.60, 2.16, 1.545)},
           0.034, 0.20);
    b.pipe(std::array{Vector3(side * 0.80, 1.58, 0.30), Vector3(side * 0.80, 1.58, 0.92)}, 0.045, 0.0);
    b.roundBox({side > 0 ? 0.74 : -0.86, 1.55, 0.16}, {side > 0 ? 0.86 : -0.74, 2.24, 0.28}, 0.03);
  }
  b.pipe(std::array{Vector3(-0.60, 2.16, 1.545), Vector3(0.0, 2.19, 1.57), Vector3(0.60, 2.16, 1.545)}, 0.034,
         0.60);
  // dashboard, steering wheel, floor
  b.paint(0x3B4147).roundBox({-0.70, 1.66, 0.76}, {0.70, 1.98, 0.94}, 0.06);
  b.roundBox({-0.55, 1.90, 0.90}, {-0.18, 2.02, 1.00}, 0.045);
  b.roundBox({-0.14, 1.80, 0.40}, {0.14, 2.10, 0.80}, 0.04);
  b.paint(0x2A2E32).torus({-0.36, 2.12, 0.90}, Vector3(0.0, 0.85, 0.52).normalized(), 0.175, 0.015);
  b.cylinder({-0.36, 1.90, 0.76}, {-0.36, 2.13, 0.905}, 0.022);
  b.roundBox({-0.42, 2.08, 0.85}, {-0.30, 2.14, 0.95}, 0.025);
  for (const double x : {-0.165, 0.165})
    b.pipe(std::array{Vector3(-0.36, 2.11, 0.90), Vector3(-0.36 + x, 2.12, 0.90)}, 0.011, 0.0);
  b.paint(0x6B767E).box({-0.76, 1.545, 0.20}, {0.76, 2.24, 0.215});
}

void addNose(MeshBuilder& b) {
  // bumper cover: an open sheet, bowed and rounded
  b.paint(kPaint).sheet(b.steps(48, 320), b.steps(10, 60), [&](double u, double v) {
    const double t = 2.0 * u - 1.0;
    const double angle = kPi * (0.15 + 0.70 * v);
    const Vector2 d = direction(angle);
    const double y = 0.085 + 0.13 * t * t * t * t - 0.050 * d.y();
    return Vector3(0.80 * t, y, 0.245 - 0.095 * d.x());
  });
  b.paint(kRubber);
  std::vector<Vector3> strip;
  const int n = b.steps(16, 100);
  for (int i = 0; i <= n; ++i) {
    const double t = 2.0 * i / n - 1.0;
    strip.emplace_back(0.79 * t, 0.034 + 0.13 * t * t * t * t, 0.245);
  }
  b.pipe(strip, 0.012, 0.0);
}

}  // namespace

void addPanels(MeshBuilder& b) {
  for (const double side : {-1.0, 1.0}) {
    addWheel(b, side);
    addFender(b, side);
    addLamp(b, side);
  }
  addCabin(b);
  addNose(b);
}

}  // namespace tenon::part_generator::engine_bay
