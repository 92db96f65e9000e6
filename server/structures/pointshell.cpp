#include "server/structures/pointshell.h"

#include <algorithm>

namespace tenon {

Pointshell::Pointshell(const Layout& layout, std::shared_ptr<const void> owner)
    : layout_(layout), owner_(std::move(owner)) {
  if (layout_.points.empty()) return;
  Eigen::AlignedBox3d box;
  for (const ShellPoint& point : layout_.points) box.extend(point.p_MP.cast<double>());
  p_MC_ = box.center();
  for (const ShellPoint& point : layout_.points) {
    const Vector3 p_MP = point.p_MP.cast<double>();
    radius_ = std::max(radius_, p_MP.norm());
    ball_radius_ = std::max(ball_radius_, (p_MP - p_MC_).norm());
  }
}

}  // namespace tenon
