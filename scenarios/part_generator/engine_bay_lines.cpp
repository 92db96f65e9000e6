#include <array>

#include "scenarios/part_generator/engine_bay_builders.h"
#include "scenarios/part_generator/hardware.h"

namespace tenon::part_generator::engine_bay {
namespace {

constexpr Color kRubber = 0x1E2123;
constexpr Color kAluminium = 0xC6CCD0;

void addHoses(MeshBuilder& b) {
  // coolant: from the radiator's tanks to the engine
  b.paint(kRubber);
  b.pipe(std::array{Vector3(0.385, 0.390, 0.675), Vector3(0.385, 0.440, 0.675), Vector3(0.300, 0.520, 0.640),
                    Vector3(0.300, 0.700, 0.610), Vector3(0.225, 0.830, 0.575), Vector3(0.195, 0.830, 0.572)},
         0.019, 0.05);
  b.pipe(
      std::array{Vector3(-0.385, 0.390, 0.380), Vector3(-0.385, 0.480, 0.380), Vector3(-0.310, 0.600, 0.330),
                 Vector3(-0.300, 0.760, 0.330), Vector3(-0.200, 0.780, 0.340)},
      0.019, 0.06);
  addClamp(b, {0.385, 0.410, 0.675}, Vector3::UnitY(), 0.019);
  addClamp(b, {-0.385, 0.410, 0.380}, Vector3::UnitY(), 0.019);
  addClamp(b, {-0.302, 0.720, 0.330}, Vector3::UnitY(), 0.019);
  // air: from the filter to the throttle
  b.paint(0x2A2E31).hose(
      std::array{Vector3(0.375, 1.020, 0.580), Vector3(0.375, 0.900, 0.580), Vector3(0.340, 0.760, 0.560),
                 Vector3(0.320, 0.660, 0.545), Vector3(0.225, 0.645, 0.545)},
      0.036, 0.07, 0.012, 0.004);
  addClamp(b, {0.240, 0.646, 0.545}, Vector3::UnitX(), 0.036);
  // heater hoses to the firewall and from the tank
  b.paint(kRubber);
  for (const double x : {0.06, 0.12}) {
    b.pipe(std::array{Vector3(x, 1.06, 0.570), Vector3(x, 1.13, 0.640), Vector3(x + 0.02, 1.34, 0.610),
                      Vector3(x + 0.08, 1.55, 0.620)},
           0.012, 0.06);
  }
  b.pipe(std::array{Vector3(0.41, 1.36, 0.66), Vector3(0.30, 1.30, 0.60), Vector3(0.26, 1.12, 0.560),
                    Vector3(0.205, 1.04, 0.560)},
         0.011, 0.06);
  // vacuum to the brake booster
  b.pipe(std::array{Vector3(-0.25, 0.680, 0.585), Vector3(-0.278, 0.78, 0.640), Vector3(-0.290, 1.08, 0.650),
                    Vector3(-0.350, 1.280, 0.640), Vector3(-0.360, 1.465, 0.720)},
         0.008, 0.06);
}

void addPipes(MeshBuilder& b) {
  // air conditioning along the right-hand side, under the bracket
  b.paint(kAluminium);
  for (int i = 0; i < 2; ++i) {
    const double z = 0.600 + 0.028 * i;
    b.pipe(std::array{Vector3(0.40, 0.365, z - 0.12), Vector3(0.52, 0.40, z - 0.12),
                      Vector3(0.68, 0.44, z - 0.06), Vector3(0.715, 0.60, z), Vector3(0.715, 1.02, z),
                      Vector3(0.690, 1.33, z + 0.02), Vector3(0.52, 1.545, z + 0.05)},
           0.008 - 0.002 * i, 0.05);
  }
  // brake pipes: a bundle from the valve block to the left, bent side by side
  for (int i = 0; i < 4; ++i) {
    const double d = 0.011 * i;
    b.pipe(std::array{Vector3(-0.285 + 0.016 * i, 1.35, 0.76), Vector3(-0.285 + 0.016 * i, 1.35, 0.785 + d),
                      Vector3(-0.345, 1.30 - d, 0.785 + d), Vector3(-0.47, 1.295 - d, 0.700 + d),
                      Vector3(-0.50 - d, 1.44, 0.64 + d), Vector3(-0.50 - d, 1.50, 0.40),
                      Vector3(-0.50 - d, 2.00, 0.30)},
           0.0034, 0.025);
  }
  // fuel along the firewall
  b.paint(0x6F777D);
  for (int i = 0; i < 2; ++i) {
    b.pipe(std::array{Vector3(0.15, 0.765, 0.606), Vector3(0.225 + 0.02 * i, 0.80, 0.62),
                      Vector3(0.245 + 0.02 * i, 1.12, 0.64), Vector3(0.23 + 0.02 * i, 1.30, 0.55),
                      Vector3(0.22 + 0.02 * i, 1.52, 0.40), Vector3(0.22 + 0.02 * i, 2.0, 0.24)},
           0.0045, 0.04);
  }
}

void addWiring(MeshBuilder& b) {
  // main loom under the left rail to the fuse box, in ribbed conduit, with clips
  b.paint(kRubber);
  b.hose(std::array{Vector3(-0.66, 0.455, 0.70), Vector3(-0.715, 0.52, 0.845), Vector3(-0.722, 0.95, 0.845),
                    Vector3(-0.715, 1.34, 0.845), Vector3(-0.50, 1.50, 0.86), Vector3(0.10, 1.50, 0.86),
                    Vector3(0.28, 1.46, 0.74)},
         0.009, 0.05, 0.005, 0.0015);
  b.hose(std::array{Vector3(0.69, 0.455, 0.70), Vector3(0.715, 0.55, 0.69), Vector3(0.715, 1.02, 0.685),
                    Vector3(0.66, 1.36, 0.70), Vector3(0.36, 1.40, 0.69)},
         0.008, 0.05, 0.005, 0.0015);
  b.hose(std::array{Vector3(0.20, 1.42, 0.67), Vector3(0.10, 1.25, 0.70), Vector3(0.17, 1.10, 0.655),
                    Vector3(-0.20, 1.075, 0.652)},
         0.008, 0.05, 0.005, 0.0015);
  b.paint(0xC8CDD1);
  for (int i = 0; i < 7; ++i) {
    const double y = 0.56 + 0.13 * i;
    b.tube({-0.722, y - 0.006, 0.845}, {-0.722, y + 0.006, 0.845}, 0.0115, 0.0085);
  }
  // battery cables and the earth
  b.paint(0xA32A22).pipe(
      std::array{Vector3(0.578, 0.505, 0.692), Vector3(0.640, 0.56, 0.680), Vector3(0.655, 0.60, 0.58),
                 Vector3(0.40, 0.68, 0.44), Vector3(0.10, 0.72, 0.45)},
      0.0075, 0.04);
  b.paint(kRubber).pipe(std::array{Vector3(0.385, 0.505, 0.692), Vector3(0.330, 0.53, 0.66),
                                   Vector3(0.325, 0.58, 0.48), Vector3(0.42, 0.62, 0.465)},
                        0.0075, 0.03);
  // thin leads, each with its own bends
  const std::array<Color, 6> colors{0xC23B2E, 0x2F6A3A, 0xD9B23A, 0x2C4F8F, 0x6A3A7A, 0xC97A2A};
  for (int i = 0; i < 6; ++i) {
    const double d = 0.005 * i;
    b.paint(colors[static_cast<std::size_t>(i)]);
    b.pipe(std::array{Vector3(0.225 + 0.02 * i, 1.35, 0.70), Vector3(0.225 + 0.02 * i, 1.30, 0.672 + d),
                      Vector3(0.10 - d, 1.22, 0.655 + d), Vector3(-0.05 - 0.03 * i, 1.12, 0.645 + 0.3 * d),
                      Vector3(-0.19 + 0.07 * i, 1.046, 0.640)},
           0.0020, 0.03);
  }
  // lamps
  for (const double side : {-1.0, 1.0}) {
    addConnector(b, {side * 0.58, 0.310, 0.64}, Vector3::UnitY(), {0.05, 0.03}, 8, 0x30353A);
    b.paint(kRubber).hose(std::array{Vector3(side * 0.58, 0.345, 0.645), Vector3(side * 0.58, 0.375, 0.66),
                                     Vector3(side * 0.66, 0.455, 0.70)},
                          0.008, 0.03, 0.005, 0.0015);
  }
}

}  // namespace

void addLines(MeshBuilder& b) {
  addHoses(b);
  addPipes(b);
  addWiring(b);
}

}  // namespace tenon::part_generator::engine_bay
