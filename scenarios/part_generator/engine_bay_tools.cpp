#include <array>

#include "scenarios/part_generator/engine_bay_builders.h"
#include "scenarios/part_generator/engine_bay_layout.h"
#include "scenarios/part_generator/hardware.h"

namespace tenon::part_generator::engine_bay {

PartMesh makeDrill(double detail) {
  MeshBuilder b(detail);
  const double z = kDrillTip.z();
  const Vector3 x = Vector3::UnitX();
  // bit and chuck
  b.paint(0xBFC5CA).cylinder({kDrillTip.x() - 0.080, 0, z}, {kDrillTip.x() - 0.004, 0, z}, 0.003);
  b.cone({kDrillTip.x() - 0.005, 0, z}, kDrillTip, 0.003, 0.0005);
  const std::array<Vector2, 6> chuck{Vector2(0.019, 0.0),   Vector2(0.019, 0.022), Vector2(0.016, 0.025),
                                     Vector2(0.016, 0.034), Vector2(0.006, 0.046), Vector2(0.0, 0.046)};
  b.paint(0x34393D).lathe({0.094, 0, z}, x, chuck);
  // motor housing
  const std::array<Vector2, 9> housing{Vector2(0.0, 0.0),     Vector2(0.020, 0.0),   Vector2(0.028, 0.008),
                                       Vector2(0.030, 0.030), Vector2(0.030, 0.110), Vector2(0.027, 0.125),
                                       Vector2(0.027, 0.150), Vector2(0.021, 0.160), Vector2(0.0, 0.160)};
  b.paint(0xE08A1E).lathe({-0.064, 0, z}, x, housing);
  b.paint(0x2A2E31).tube({0.050, 0, z}, {0.062, 0, z}, 0.031, 0.026);
  for (int i = 0; i < 5; ++i) {
    for (const double side : {-1.0, 1.0}) {
      b.box({-0.050 + 0.010 * i, side * 0.0285 - 0.003, z - 0.012},
            {-0.046 + 0.010 * i, side * 0.0285 + 0.003, z + 0.012});
    }
  }
  // handle, trigger, battery
  b.paint(0x2A2E31).roundBox({-0.022, -0.016, -0.050}, {0.022, 0.016, 0.070}, 0.014);
  b.paint(0xB03020).roundBox({0.012, -0.007, 0.020}, {0.032, 0.007, 0.048}, 0.006);
  b.paint(0xE08A1E).roundBox({-0.036, -0.030, -0.056}, {0.044, 0.030, -0.036}, 0.008);
  b.paint(0x2A2E31).roundBox({-0.036, -0.030, -0.090}, {0.044, 0.030, -0.050}, 0.008);
  return b.take();
}

PartMesh makePointer(double detail) {
  MeshBuilder b(detail);
  b.paint(0xE02020).sphere(Vector3::Zero(), 0.012);
  return b.take();
}

PartMesh makeForearm(double detail) {
  MeshBuilder b(detail);
  std::vector<Vector2> profile;
  const int n = b.steps(6, 24);
  // hemispherical elbow, tapering to a hemispherical wrist
  for (int i = 0; i <= n; ++i) {
    const Vector2 d = direction(0.5 * kPi * i / n);
    profile.emplace_back(0.042 * d.y(), -0.042 * d.x());
  }
  profile.front().x() = 0.0;
  profile.emplace_back(0.046, 0.06);
  profile.emplace_back(0.040, 0.14);
  for (int i = 0; i <= n; ++i) {
    const Vector2 d = direction(0.5 * kPi * i / n);
    profile.emplace_back(0.028 * d.x(), 0.26 + 0.028 * d.y());
  }
  profile.back().x() = 0.0;
  b.paint(0x3FAE49).lathe(Vector3::Zero(), Vector3::UnitX(), profile);
  return b.take();
}

PartMesh makeAssistant(double detail) {
  MeshBuilder b(detail);
  b.paint(0x2F6FE0).box(Vector3::Constant(-0.025), Vector3::Constant(0.025));
  return b.take();
}

PartMesh makeHead(double detail) {
  MeshBuilder b(detail);
  b.paint(0xD9B99B).roundBox({-0.075, -0.095, -0.12}, {0.075, 0.095, 0.12}, 0.074);
  b.cylinder({0, -0.015, -0.17}, {0, -0.015, -0.06}, 0.052);
  b.roundBox({-0.012, 0.08, -0.025}, {0.012, 0.112, 0.015}, 0.010);
  // the head-mounted display
  b.paint(0x24282C).roundBox({-0.085, 0.060, -0.005}, {0.085, 0.130, 0.075}, 0.018);
  b.roundBox({-0.082, -0.100, 0.020}, {0.082, 0.090, 0.048}, 0.012);
  return b.take();
}

}  // namespace tenon::part_generator::engine_bay
