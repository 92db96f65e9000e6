#include "scenarios/part_generator/hardware.h"

#include <array>

namespace tenon::part_generator {
namespace {

/// Runs `draw` with the builder in a frame at `origin` whose z is `axis`, both given in the builder's current
/// frame.
template <typename Draw>
void inFrame(MeshBuilder& b, const Vector3& origin, const Vector3& axis, const Draw& draw) {
  const Pose X_MF = b.frame();
  b.at(X_MF * Pose(origin, zTo(axis)));
  draw();
  b.at(X_MF);
}

}  // namespace

Pose alongX() { return {Vector3::Zero(), Quaternion(0.5, 0.5, 0.5, 0.5)}; }
Pose alongY() { return {Vector3::Zero(), Quaternion(0.5, -0.5, -0.5, -0.5)}; }

void addHexBolt(MeshBuilder& b, const Vector3& seat, const Vector3& axis, double size) {
  inFrame(b, seat, axis, [&] {
    const double across = 0.87 * size;
    b.cylinder({0, 0, -0.4 * size}, {0, 0, 0.12 * size}, 1.1 * size, 0.02 * size);
    b.prism(circle(Vector2::Zero(), across, 6), {}, 0.10 * size, 0.72 * size);
    const std::array<Vector2, 4> dome{Vector2(0.72 * size, 0.70 * size), Vector2(0.70 * size, 0.76 * size),
                                      Vector2(0.55 * size, 0.80 * size), Vector2(0.0, 0.80 * size)};
    b.lathe(Vector3::Zero(), Vector3::UnitZ(), dome);
    b.cylinder({0, 0, -1.2 * size}, {0, 0, 0}, 0.5 * size);
  });
}

void addBoltRow(MeshBuilder& b, const Vector3& first, const Vector3& last, int count, const Vector3& axis,
                double size) {
  for (int i = 0; i < count; ++i)
    addHexBolt(b, first + (last - first) * i / std::max(1, count - 1), axis, size);
}

void addBoss(MeshBuilder& b, const Vector3& foot, const Vector3& axis, double outer, double inner,
             double height) {
  const std::array<Vector2, 7> profile{Vector2(1.15 * outer, 0.0),    Vector2(outer, 0.2 * height),
                                       Vector2(outer, 0.95 * height), Vector2(0.93 * outer, height),
                                       Vector2(inner, height),        Vector2(inner, 0.3 * height),
                                       Vector2(0.0, 0.2 * height)};
  b.lathe(foot, axis, profile);
}

void addConnector(MeshBuilder& b, const Vector3& face, const Vector3& axis, const Vector2& size, int pins,
                  Color color) {
  inFrame(b, face, axis, [&] {
    const double w = 0.5 * size.x();
    const double d = 0.5 * size.y();
    b.paint(0x26292C).roundBox({-w - 0.003, -d - 0.003, -0.004}, {w + 0.003, d + 0.003, 0.005}, 0.002);
    b.paint(color).roundBox({-w, -d, -0.002}, {w, d, 0.024}, 0.003);
    b.box({-0.3 * w, d - 0.001, 0.006}, {0.3 * w, d + 0.003, 0.026});
    for (int i = -3; i <= 3; ++i)
      b.box({i * w / 4.0 - 0.0008, -d - 0.001, 0.006}, {i * w / 4.0 + 0.0008, d + 0.001, 0.022});
    b.paint(0x1B1D1F);
    for (int i = 0; i < pins; ++i) {
      const double x = pins == 1 ? 0.0 : (2.0 * i / (pins - 1) - 1.0) * 0.75 * w;
      b.tube({x, 0.0, 0.020}, {x, 0.0, 0.036}, 0.0028, 0.0016);
      b.pipe(std::array{Vector3(x, 0, 0.018), Vector3(x, 0, 0.046), Vector3(0.6 * x, -0.010, 0.058)}, 0.0013,
             0.008);
    }
  });
}

void addClamp(MeshBuilder& b, const Vector3& centre, const Vector3& axis, double radius) {
  inFrame(b, centre, axis, [&] {
    b.paint(0xC4C9CD).tube({0, 0, -0.005}, {0, 0, 0.005}, radius + 0.0015, radius - 0.001);
    b.box({-0.007, radius, -0.006}, {0.007, radius + 0.006, 0.006});
    b.cylinder({-0.011, radius + 0.004, 0}, {0.013, radius + 0.004, 0}, 0.0032, 0.0005);
  });
}

void addPulley(MeshBuilder& b, const Vector3& centre, const Vector3& axis, double radius, double width) {
  inFrame(b, centre, axis, [&] {
    std::vector<Vector2> profile{{0.3 * radius, -0.5 * width}, {radius, -0.5 * width}};
    const int grooves = 5;
    for (int i = 0; i < grooves; ++i) {
      const double z = width * (-0.40 + 0.8 * i / grooves);
      profile.emplace_back(radius, z);
      profile.emplace_back(0.95 * radius, z + 0.08 * width);
      profile.emplace_back(radius, z + 0.16 * width);
    }
    profile.emplace_back(radius, 0.5 * width);
    profile.emplace_back(0.88 * radius, 0.5 * width);
    profile.emplace_back(0.80 * radius, 0.1 * width);
    profile.emplace_back(0.35 * radius, 0.1 * width);
    profile.emplace_back(0.30 * radius, 0.5 * width);
    b.lathe(Vector3::Zero(), Vector3::UnitZ(), profile);
    addHexBolt(b, {0, 0, 0.5 * width}, Vector3::UnitZ(), 0.2 * radius);
  });
}

}  // namespace tenon::part_generator
