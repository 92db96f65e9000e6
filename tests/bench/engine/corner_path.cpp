#include "tests/bench/engine/corner_path.h"

#include <array>
#include <cstddef>
#include <iterator>

#include <fmt/format.h>

#include "tests/bench/engine/held_box.h"

namespace tenon::bench {
namespace {

constexpr double kCornerVoxel = 0.003;        // [m]
constexpr double kTickDisplacement = 0.0005;  // [m] per tick: 0.5 m/s

struct NamedMethod {
  const char* name;
  collision::ContactMethod method;
};
constexpr std::array kMethods{NamedMethod{"god object", collision::ContactMethod::kIsland},
                              NamedMethod{"blocking", collision::ContactMethod::kBlocking}};

// wall at x = 0, floor at z = 0; y is far from the third wall
constexpr double kY = 0.15;
const std::array<Vector3, 4> kHandPath{Vector3(0.12, kY, 0.06), Vector3(0.10, kY, -0.005),
                                       Vector3(0.01, kY, -0.015), Vector3(0.02, kY, 0.08)};

void appendPath(const NamedMethod& method, std::string& out) {
  HeldBox held(method.method, test::cornerStructures(0.3, kCornerVoxel), HeldBox::dilationOf(kCornerVoxel),
               Pose(kHandPath[0]));
  int tick = 0;
  for (std::size_t leg = 0; leg + 1 < kHandPath.size(); ++leg) {
    const Vector3 displacement = kHandPath[leg + 1] - kHandPath[leg];
    const int ticks = static_cast<int>(displacement.norm() / kTickDisplacement);
    for (int i = 1; i <= ticks; ++i) {
      const Vector3 hand = kHandPath[leg] + displacement * (static_cast<double>(i) / ticks);
      held.step(Pose(hand));
      const Vector3 p = held.pose().translation();
      const Vector3 f = held.force();
      fmt::format_to(std::back_inserter(out), "{},{},{:.6f},{:.6f},{:.6f},{:.6f},{:.3f},{:.3f}\n",
                     method.name, tick++, hand.x(), hand.z(), p.x(), p.z(), f.x(), f.z());
    }
  }
}

}  // namespace

std::string cornerPath() {
  std::string out = "method,tick,hand_x,hand_z,box_x,box_z,force_x,force_z\n";
  for (const NamedMethod& method : kMethods) appendPath(method, out);
  return out;
}

}  // namespace tenon::bench
