#include "tests/bench/engine/corner_path.h"

#include <array>
#include <cstddef>
#include <iterator>

#include <fmt/format.h>

#include "tests/bench/engine/held_box.h"

namespace tenon::bench {
namespace {

constexpr double kCornerVoxel = 0.003;
constexpr double kTickWay = 0.0005;  // [m] 0.5 m/s

struct NamedMethod {
  const char* name;
  ContactMethod method;
};
constexpr std::array kMethods{NamedMethod{"god object", ContactMethod::kIsland},
                              NamedMethod{"blocking", ContactMethod::kBlocking}};

// walls at x = 0 and z = 0; y is far from everything
constexpr double kY = 0.15;
const std::array<Vector3, 4> kHand{Vector3(0.12, kY, 0.06), Vector3(0.10, kY, -0.005),
                                   Vector3(0.01, kY, -0.015), Vector3(0.02, kY, 0.08)};

void follow(const NamedMethod& one, std::string& out) {
  HeldBox held(one.method, test::cornerStructures(0.3, kCornerVoxel), HeldBox::dilationOf(kCornerVoxel),
               Pose(kHand[0]));
  int tick = 0;
  for (std::size_t leg = 0; leg + 1 < kHand.size(); ++leg) {
    const Vector3 way = kHand[leg + 1] - kHand[leg];
    const int ticks = static_cast<int>(way.norm() / kTickWay);
    for (int i = 1; i <= ticks; ++i) {
      const Vector3 hand = kHand[leg] + way * (static_cast<double>(i) / ticks);
      held.step(Pose(hand));
      const Vector3 p = held.pose().translation();
      const Vector3 f = held.force();
      fmt::format_to(std::back_inserter(out), "{},{},{:.6f},{:.6f},{:.6f},{:.6f},{:.3f},{:.3f}\n", one.name,
                     tick++, hand.x(), hand.z(), p.x(), p.z(), f.x(), f.z());
    }
  }
}

}  // namespace

std::string cornerPath() {
  std::string out = "method,tick,hand_x,hand_z,box_x,box_z,force_x,force_z\n";
  for (const NamedMethod& one : kMethods) follow(one, out);
  return out;
}

}  // namespace tenon::bench
