#include <array>

#include "scenarios/part_generator/engine_bay_builders.h"
#include "scenarios/part_generator/hardware.h"

namespace tenon::part_generator::engine_bay {
namespace {

constexpr Color kBlack = 0x25292C;
constexpr Color kSteel = 0xC0C6CA;

void addRadiator(MeshBuilder& b) {
  const double y_front = 0.350;
  const double y_back = 0.385;
  b.paint(0xA9B0B4).box({-0.365, y_front, 0.700}, {0.365, y_back, 0.715});
  b.box({-0.365, y_front, 0.330}, {0.365, y_back, 0.345});
  for (const double side : {-1.0, 1.0}) {
    b.paint(kBlack).roundBox({side > 0 ? 0.360 : -0.410, y_front - 0.008, 0.325},
                             {side > 0 ? 0.410 : -0.360, y_back + 0.012, 0.720}, 0.012);
    for (int i = 0; i < 9; ++i)
      b.roundBox({side * 0.385 - 0.027, y_front - 0.011, 0.35 + 0.042 * i},
                 {side * 0.385 + 0.027, y_back + 0.015, 0.354 + 0.042 * i}, 0.0018);
  }
  // flat tubes lie between the tanks; folded fins, bare sheets, stand between the tubes
  const int rows = 34;
  const double pitch = 0.355 / rows;
  const int folds = b.steps(36, 150);
  for (int row = 0; row < rows; ++row) {
    const double z = 0.345 + pitch * row;
    b.paint(0xB9C0C4).box({-0.365, y_front + 0.003, z}, {0.365, y_back - 0.003, z + 0.0020});
    b.paint(0x8C959B).sheet(2 * folds, 1, [&](double u, double v) {
      const bool high = static_cast<int>(u * 2.0 * folds + 0.5) % 2 == 1;
      return Vector3(-0.36 + 0.72 * u, y_front + 0.004 + 0.027 * v, z + (high ? pitch - 0.0002 : 0.0022));
    });
  }
}

void addFan(MeshBuilder& b, const Vector3& hub) {
  const Vector3 y = Vector3::UnitY();
  b.paint(kBlack).tube(hub - 0.006 * y, hub + 0.050 * y, 0.172, 0.165);
  b.tube(hub + 0.042 * y, hub + 0.048 * y, 0.060, 0.050);
  for (int i = 0; i < 9; ++i) {
    const Vector2 d = direction(2.0 * kPi * i / 9.0);
    const Vector3 radial(d.x(), 0.0, d.y());
    b.pipe(std::array{Vector3(hub + 0.045 * y + 0.055 * radial), Vector3(hub + 0.045 * y + 0.167 * radial)},
           0.0035, 0.0);
  }
  b.paint(0x33393D).cylinder(hub - 0.002 * y, hub + 0.024 * y, 0.045, 0.006);
  b.cylinder(hub + 0.020 * y, hub + 0.062 * y, 0.034, 0.005);
  for (int blade = 0; blade < 7; ++blade) {
    b.sheet(b.steps(6, 40), b.steps(4, 28), [&](double u, double v) {
      const double radius = 0.042 + 0.118 * u;
      const Vector2 d = direction(2.0 * kPi * blade / 7.0 + 0.55 * (v - 0.5) + 0.45 * u);
      return Vector3(hub + Vector3(radius * d.x(), 0.004 + 0.030 * v - 0.006 * u, radius * d.y()));
    });
  }
}

void addBattery(MeshBuilder& b) {
  const Vector3 low(0.36, 0.475, 0.500);
  const Vector3 high(0.60, 0.635, 0.665);
  b.paint(0x6C7780).box({0.34, 0.46, 0.485}, {0.62, 0.65, 0.495});
  b.box({0.34, 0.46, 0.485}, {0.62, 0.464, 0.53});
  b.box({0.34, 0.646, 0.485}, {0.62, 0.650, 0.53});
  for (const double x : {0.44, 0.50}) b.box({x, 0.50, 0.455}, {x + 0.03, 0.62, 0.490});
  b.paint(0x2B3034).roundBox(low, high, 0.008);
  b.paint(0x22262A).roundBox({0.355, 0.470, 0.640}, {0.605, 0.640, 0.676}, 0.006);
  b.paint(0xC8CDD1);
  for (int i = 0; i < 6; ++i)
    b.cylinder({0.39 + 0.036 * i, 0.555, 0.672}, {0.39 + 0.036 * i, 0.555, 0.680}, 0.011, 0.002);
  b.paint(0xE8E4D4).box({0.40, 0.4735, 0.53}, {0.56, 0.4752, 0.62});
  b.paint(0x9A9FA3).cylinder({0.385, 0.505, 0.67}, {0.385, 0.505, 0.694}, 0.009, 0.001);
  b.cylinder({0.575, 0.505, 0.67}, {0.575, 0.505, 0.694}, 0.009, 0.001);
  b.paint(0xB8322A).roundBox({0.555, 0.480, 0.680}, {0.600, 0.530, 0.700}, 0.006);
  b.paint(kBlack).roundBox({0.365, 0.485, 0.680}, {0.405, 0.525, 0.698}, 0.006);
  b.paint(kSteel).box({0.345, 0.595, 0.676}, {0.615, 0.615, 0.680});
  for (const double x : {0.350, 0.610}) addHexBolt(b, {x, 0.605, 0.680}, Vector3::UnitZ(), 0.008);
}

void addBrakes(MeshBuilder& b) {
  const Vector3 forward = -Vector3::UnitY();
  const std::array<Vector2, 10> booster{Vector2(0.0, 0.0),     Vector2(0.100, 0.0),   Vector2(0.108, 0.010),
                                        Vector2(0.108, 0.045), Vector2(0.113, 0.048), Vector2(0.113, 0.056),
                                        Vector2(0.105, 0.060), Vector2(0.088, 0.085), Vector2(0.040, 0.100),
                                        Vector2(0.0, 0.100)};
  b.paint(0x30353A).lathe({-0.42, 1.540, 0.72}, forward, booster);
  b.paint(0xB4BABF).cylinder({-0.42, 1.445, 0.72}, {-0.42, 1.315, 0.72}, 0.024, 0.004);
  for (const double y : {1.345, 1.375, 1.405}) b.cylinder({-0.42, y, 0.70}, {-0.42, y, 0.752}, 0.010, 0.001);
  b.paint(0xE6E3D3).roundBox({-0.458, 1.325, 0.745}, {-0.382, 1.425, 0.800}, 0.016);
  b.paint(kBlack).cylinder({-0.42, 1.375, 0.795}, {-0.42, 1.375, 0.822}, 0.026, 0.004);
  // block of valves
  b.paint(0xB4BABF).roundBox({-0.30, 1.30, 0.66}, {-0.19, 1.40, 0.75}, 0.004);
  b.paint(kBlack).roundBox({-0.305, 1.395, 0.65}, {-0.185, 1.46, 0.76}, 0.010);
  b.cylinder({-0.245, 1.30, 0.70}, {-0.245, 1.235, 0.70}, 0.028, 0.004);
  for (int i = 0; i < 6; ++i) {
    b.paint(kSteel).cylinder({-0.285 + 0.016 * i, 1.35, 0.745}, {-0.285 + 0.016 * i, 1.35, 0.765}, 0.0055,
                             0.001);
  }
}

void addTanks(MeshBuilder& b) {
  // coolant tank: a rounded box of two halves with a seam
  b.paint(0xDDE2DC).roundBox({0.40, 1.33, 0.62}, {0.60, 1.50, 0.80}, 0.060);
  b.roundBox({0.392, 1.322, 0.706}, {0.608, 1.508, 0.714}, 0.0035);
  b.paint(0x2C3D66).cylinder({0.50, 1.415, 0.79}, {0.50, 1.415, 0.832}, 0.036, 0.005);
  for (int i = 0; i < 12; ++i) {
    const Vector2 d = direction(2.0 * kPi * i / 12.0);
    b.cylinder({0.50 + 0.036 * d.x(), 1.415 + 0.036 * d.y(), 0.80},
               {0.50 + 0.036 * d.x(), 1.415 + 0.036 * d.y(), 0.83}, 0.004);
  }
  // washer bottle's neck
  b.paint(0xDDE2DC).pipe(
      std::array{Vector3(0.665, 0.52, 0.46), Vector3(0.665, 0.52, 0.60), Vector3(0.66, 0.50, 0.675)}, 0.024,
      0.05);
  b.paint(0x2C6FB0).cylinder({0.66, 0.497, 0.670}, {0.658, 0.492, 0.695}, 0.034, 0.004);
  // air filter
  b.paint(kBlack).roundBox({0.315, 1.02, 0.43}, {0.44, 1.26, 0.56}, 0.018);
  b.paint(0x30353A).roundBox({0.310, 1.015, 0.545}, {0.445, 1.265, 0.615}, 0.022);
  for (int i = 0; i < 8; ++i)
    b.roundBox({0.322, 1.045 + 0.027 * i, 0.60}, {0.433, 1.051 + 0.027 * i, 0.622}, 0.0025);
  b.paint(kSteel);
  for (const double y : {1.06, 1.22}) b.box({0.306, y - 0.008, 0.52}, {0.312, y + 0.008, 0.58});
  // fuse box at the back
  b.paint(kBlack).roundBox({0.20, 1.34, 0.64}, {0.36, 1.47, 0.715}, 0.008);
  b.paint(0x30353A).roundBox({0.195, 1.335, 0.705}, {0.365, 1.475, 0.745}, 0.010);
  b.paint(0xE2C23A).box({0.22, 1.37, 0.7445}, {0.34, 1.44, 0.7455});
  // horn
  b.paint(kBlack).cylinder({-0.58, 0.33, 0.42}, {-0.58, 0.37, 0.42}, 0.045, 0.008);
}

}  // namespace

void addCooling(MeshBuilder& b) {
  addRadiator(b);
  b.paint(kBlack).box({-0.36, 0.388, 0.335}, {-0.345, 0.430, 0.71});
  b.box({0.345, 0.388, 0.335}, {0.36, 0.430, 0.71});
  for (const double x : {-0.175, 0.175}) addFan(b, {x, 0.405, 0.525});
  b.box({-0.36, 0.388, 0.697}, {0.36, 0.430, 0.712});
  b.box({-0.36, 0.388, 0.335}, {0.36, 0.430, 0.350});
}

void addAncillaries(MeshBuilder& b) {
  addBattery(b);
  addBrakes(b);
  addTanks(b);
}

}  // namespace tenon::part_generator::engine_bay
