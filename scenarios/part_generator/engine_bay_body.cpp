#include <array>

#include "scenarios/part_generator/engine_bay_builders.h"
#include "scenarios/part_generator/engine_bay_layout.h"
#include "scenarios/part_generator/hardware.h"

namespace tenon::part_generator::engine_bay {
namespace {

constexpr Color kBodyColor = 0x9AA6AE;
constexpr std::array kSides{-1.0, 1.0};

/// A box given for the right side, mirrored to `side`.
void mirroredBox(MeshBuilder& b, double side, const Vector3& low, const Vector3& high) {
  if (side > 0.0) {
    b.box(low, high);
  } else {
    b.box({-high.x(), low.y(), low.z()}, {-low.x(), high.y(), high.z()});
  }
}

/// A plate in the plane of y and z, `outline` of (y, z), from x to x + thickness on the given side.
void sidePlate(MeshBuilder& b, double side, const Polygon& outline, std::span<const Polygon> holes, double x,
               double thickness) {
  b.at(alongX());
  if (side > 0.0) {
    b.prism(outline, holes, x, x + thickness);
  } else {
    b.prism(outline, holes, -x - thickness, -x);
  }
  b.at(Pose());
}

void addFrameRails(MeshBuilder& b) {
  for (const double side : kSides) {
    b.paint(kBodyColor);
    std::vector<Polygon> holes;
    for (int i = 0; i < 9; ++i) holes.push_back(circle({0.30 + 0.20 * i, 0.40}, 0.018, b.segments(0.02)));
    const Polygon flank{{0.16, 0.35}, {1.60, 0.34}, {2.12, 0.26}, {2.12, 0.38}, {1.60, 0.46}, {0.16, 0.46}};
    sidePlate(b, side, flank, holes, 0.420, 0.003);
    sidePlate(b, side, flank, holes, 0.517, 0.003);
    mirroredBox(b, side, {0.420, 0.16, 0.457}, {0.520, 1.60, 0.460});
    mirroredBox(b, side, {0.420, 0.16, 0.345}, {0.520, 1.60, 0.349});
    mirroredBox(b, side, {0.400, 0.155, 0.33}, {0.540, 0.165, 0.48});
    b.paint(0xB4BABF);
    addBoltRow(b, {side * 0.47, 0.36, 0.46}, {side * 0.47, 1.50, 0.46}, 9, Vector3::UnitZ(), 0.010);
    addBoltRow(b, {side * 0.52, 0.50, 0.375}, {side * 0.52, 1.45, 0.375}, 8, Vector3(side, 0, 0), 0.008);
  }
  b.paint(kBodyColor).box({-0.640, 0.62, 0.440}, {-0.39, 0.82, 0.452});
}

void addCrossmembers(MeshBuilder& b) {
  b.paint(kBodyColor);
  std::vector<Polygon> holes;
  for (int i = -6; i <= 6; ++i) {
    if (i % 6 != 0)
      holes.push_back(roundedRectangle({0.095 * i, 0.44}, {0.050, 0.022}, 0.010, b.steps(2, 12)));
  }
  b.prism(roundedRectangle({0.0, 0.44}, {1.46, 0.100}, 0.020, b.steps(3, 12)), holes, 0.772, 0.775);
  b.box({-0.72, 0.392, 0.735}, {0.72, 0.395, 0.775});
  b.box({-0.72, 0.485, 0.735}, {0.72, 0.488, 0.775});
  b.box({-0.60, 0.33, 0.26}, {0.60, 0.43, 0.263});
  b.box({-0.60, 0.33, 0.26}, {0.60, 0.333, 0.32});
  b.box({-0.60, 0.427, 0.26}, {0.60, 0.43, 0.32});
  for (const double side : kSides) {
    mirroredBox(b, side, {0.46, 0.37, 0.26}, {0.50, 0.43, 0.775});
    mirroredBox(b, side, {0.68, 0.39, 0.46}, {0.72, 0.45, 0.775});
    mirroredBox(b, side, {0.735, 0.36, 0.885}, {0.800, 1.56, 0.930});
    mirroredBox(b, side, {0.725, 0.36, 0.926}, {0.830, 1.56, 0.930});
    mirroredBox(b, side, {0.69, 0.38, 0.76}, {0.76, 0.46, 0.93});
    b.paint(0xB4BABF);
    addBoltRow(b, {side * 0.765, 0.42, 0.930}, {side * 0.765, 1.50, 0.930}, 14, Vector3::UnitZ(), 0.009);
    addBoltRow(b, {side * 0.40, 0.44, 0.775}, {side * 0.66, 0.44, 0.775}, 4, Vector3::UnitZ(), 0.009);
    b.paint(kBodyColor);
  }
  // bumper beam, slightly bowed
  Polygon beam;
  const int n = b.steps(8, 64);
  for (int i = 0; i <= n; ++i)
    beam.emplace_back(-0.70 + 1.40 * i / n, 0.085 + 0.075 * (2.0 * i / n - 1.0) * (2.0 * i / n - 1.0));
  for (int i = n; i >= 0; --i)
    beam.emplace_back(-0.70 + 1.40 * i / n, 0.135 + 0.065 * (2.0 * i / n - 1.0) * (2.0 * i / n - 1.0));
  b.paint(0x7B878F).prism(beam, {}, 0.235, 0.335);
}

void addInnerFenders(MeshBuilder& b) {
  for (const double side : kSides) {
    // the panel over the wheel: its lower edge follows the arch
    Polygon outline{{0.36, 0.46}};
    const int n = b.steps(10, 80);
    for (int i = 0; i <= n; ++i) {
      const Vector2 d = direction(kPi * (1.0 - static_cast<double>(i) / n));
      outline.emplace_back(0.95 + 0.38 * d.x(), 0.46 + 0.22 * d.y());
    }
    outline.emplace_back(1.55, 0.46);
    outline.emplace_back(1.55, 0.93);
    outline.emplace_back(0.36, 0.93);
    std::vector<Polygon> holes;
    for (const double y : {0.44, 0.56, 1.42}) holes.push_back(circle({y, 0.60}, 0.022, b.segments(0.02)));
    b.paint(0x8E9BA4);
    sidePlate(b, side, outline, holes, 0.7335, 0.003);
    for (const double z : {0.72, 0.775, 0.86}) {
      const double y_low = side > 0.0 ? 0.92 : 0.42;
      b.pipe(std::array{Vector3(side * 0.735, y_low, z), Vector3(side * 0.735, 1.50, z)}, 0.007, 0.0);
    }
    // strut tower with its dome, three nuts and the cap
    const std::array<Vector2, 8> tower{Vector2(0.150, 0.0),   Vector2(0.138, 0.10),  Vector2(0.132, 0.20),
                                       Vector2(0.120, 0.232), Vector2(0.098, 0.240), Vector2(0.090, 0.252),
                                       Vector2(0.055, 0.256), Vector2(0.0, 0.256)};
    const Vector3 foot(side * 0.605, 1.15, 0.600);
    b.paint(kBodyColor).lathe(foot, Vector3::UnitZ(), tower);
    b.paint(0x3A4046).cylinder(foot + Vector3(0, 0, 0.25), foot + Vector3(0, 0, 0.275), 0.034, 0.004);
    b.paint(0xB4BABF);
    for (int i = 0; i < 3; ++i) {
      const Vector2 d = direction(2.0 * kPi * i / 3.0 + 0.4);
      addHexBolt(b, foot + Vector3(0.068 * d.x(), 0.068 * d.y(), 0.255), Vector3::UnitZ(), 0.012);
    }
    b.paint(0x33406B).spring({side * 0.605, 1.15, 0.33}, 0.29, 0.075, 0.0065, 5);
    b.paint(0x3A4046).cylinder({side * 0.605, 1.15, 0.26}, {side * 0.605, 1.15, 0.60}, 0.026);
    mirroredBox(b.paint(kBodyColor), side, {0.60, 1.02, 0.60}, {0.737, 1.28, 0.82});
  }
  // the brace between the towers stays behind the engine
  b.paint(0x7B878F).pipe(std::array{Vector3(-0.605, 1.20, 0.858), Vector3(-0.45, 1.235, 0.885),
                                    Vector3(0.45, 1.235, 0.885), Vector3(0.605, 1.20, 0.858)},
                         0.015, 0.08);
}

void addFirewall(MeshBuilder& b) {
  b.at(alongY());
  // polygon of (z, x)
  const std::array<Polygon, 3> holes{circle({0.42, -0.30}, 0.035, b.segments(0.03)),
                                     circle({0.62, 0.20}, 0.030, b.segments(0.03)),
                                     roundedRectangle({0.70, 0.48}, {0.10, 0.16}, 0.020, b.steps(3, 12))};
  const Polygon wall{{0.20, -0.72}, {0.92, -0.76}, {0.92, 0.76}, {0.20, 0.72}};
  b.paint(kBodyColor).prism(wall, holes, 1.540, 1.543);
  b.at(Pose());
  b.paint(0x3B4247).roundBox({-0.26, 1.512, 0.40}, {0.14, 1.545, 0.86}, 0.012);
  for (int i = 0; i < 6; ++i)
    b.paint(kBodyColor).roundBox({0.24 + 0.075 * i, 1.532, 0.26}, {0.27 + 0.075 * i, 1.546, 0.56}, 0.006);
  // cowl: the trough in which the wiper mechanism lies
  b.box({-0.74, 1.255, 0.916}, {0.74, 1.545, 0.920});
  b.box({-0.74, 1.255, 0.896}, {0.74, 1.259, 0.920});
  b.box({-0.74, 1.541, 0.916}, {0.74, 1.545, 0.975});
  b.box({-0.74, 1.541, 0.971}, {0.74, 1.640, 0.975});
  for (int i = -5; i <= 5; ++i) {
    if (i == -1 || i == 1) continue;
    b.roundBox({0.125 * i - 0.02, 1.29, 0.917}, {0.125 * i + 0.02, 1.50, 0.924}, 0.004);
  }
  b.paint(0xB4BABF);
  addBoltRow(b, {-0.70, 1.60, 0.975}, {0.70, 1.60, 0.975}, 12, Vector3::UnitZ(), 0.008);
}

}  // namespace

void addPlatform(MeshBuilder& b) {
  const double x = 0.5 * kBaySize.x();
  const double y = kBaySize.y();
  const double z = kBaySize.z();
  b.paint(0x5D6B78);
  b.box({-x, 0.0, 0.0}, {x, 0.10, 0.10});
  b.box({-x, y - 0.10, 0.0}, {x, y, 0.10});
  for (const double side : kSides) {
    b.paint(0x5D6B78);
    mirroredBox(b, side, {x - 0.10, 0.0, 0.0}, {x, y, 0.10});
    mirroredBox(b, side, {x - 0.09, y - 0.09, 0.05}, {x - 0.01, y - 0.01, z - 0.05});
    mirroredBox(b, side, {x - 0.09, 0.01, 0.05}, {x - 0.01, 0.09, 0.46});
    for (const double at : {0.45, 1.45}) {
      mirroredBox(b, side, {0.56, at - 0.035, 0.02}, {x - 0.05, at + 0.035, 0.09});
      mirroredBox(b, side, {x - 0.085, at - 0.035, 0.05}, {x - 0.015, at + 0.035, 0.62});
      b.paint(0xE2B23A);
      b.pipe(std::array{Vector3(side * (x - 0.05), at, 0.58), Vector3(side * (x - 0.22), at, 0.58),
                        Vector3(side * (x - 0.34), at, 0.44)},
             0.022, 0.06);
      b.cylinder({side * (x - 0.34), at, 0.43}, {side * (x - 0.34), at, 0.47}, 0.045, 0.006);
      b.paint(0x5D6B78);
    }
    // hand rail and bolted feet
    b.paint(0xE2B23A).pipe(
        std::array{Vector3(side * (x - 0.05), 0.05, 0.44), Vector3(side * (x - 0.05), 0.05, 0.62),
                   Vector3(side * (x - 0.05), 2.31, 0.62)},
        0.020, 0.08);
    b.paint(0xB4BABF);
    addBoltRow(b, {side * (x - 0.02), 0.16, 0.10}, {side * (x - 0.02), 2.20, 0.10}, 10, Vector3::UnitZ(),
               0.014);
    addBoltRow(b, {side * (x - 0.085), 0.16, 0.10}, {side * (x - 0.085), 2.20, 0.10}, 10, Vector3::UnitZ(),
               0.014);
  }
  b.paint(0x5D6B78).box({-x, y - 0.10, z - 0.08}, {x, y, z});
  b.box({-1.0, 0.05, 0.02}, {-0.94, 2.30, 0.08});
  b.box({0.94, 0.05, 0.02}, {1.0, 2.30, 0.08});
}

void addBody(MeshBuilder& b) {
  addFrameRails(b);
  addCrossmembers(b);
  addInnerFenders(b);
  addFirewall(b);
}

}  // namespace tenon::part_generator::engine_bay
