#include "server/structures/pointshell.h"

#include <algorithm>

#include "server/structures/level_areas.h"

namespace tenon::structures {

namespace {

ShellBlock blockOf(std::span<const ShellPoint> points) {
  ShellBlock block;
  block.count = static_cast<std::uint32_t>(std::min(points.size(), ShellBlock::kLanes));
  for (std::size_t lane = 0; lane < ShellBlock::kLanes && block.count > 0; ++lane) {
    const Vector3f& p_MP = points[lane < block.count ? lane : 0].p_MP;
    block.x[lane] = p_MP.x();
    block.y[lane] = p_MP.y();
    block.z[lane] = p_MP.z();
  }
  return block;
}

ShellBlock blockOf(std::span<const ShellSphere> spheres) {
  ShellBlock block;
  block.count = static_cast<std::uint32_t>(std::min(spheres.size(), ShellBlock::kLanes));
  for (std::size_t lane = 0; lane < ShellBlock::kLanes && block.count > 0; ++lane) {
    const ShellSphere& sphere = spheres[lane < block.count ? lane : 0];
    block.x[lane] = sphere.p_MC.x();
    block.y[lane] = sphere.p_MC.y();
    block.z[lane] = sphere.p_MC.z();
    block.radius[lane] = sphere.radius;
  }
  return block;
}

/// Shells with fewer blocks of clusters are tested cluster by cluster.
constexpr std::size_t kManyBlocks = 8;

/// A bounding sphere of spheres, about the centre of their box.
ShellSphere boundingSphere(std::span<const ShellSphere> spheres) {
  Eigen::AlignedBox3f box;
  for (const ShellSphere& sphere : spheres) {
    box.extend(sphere.p_MC - Vector3f::Constant(sphere.radius));
    box.extend(sphere.p_MC + Vector3f::Constant(sphere.radius));
  }
  ShellSphere all;
  all.p_MC = box.center();
  for (const ShellSphere& sphere : spheres)
    all.radius = std::max(all.radius, (sphere.p_MC - all.p_MC).norm() + sphere.radius);
  all.radius = all.radius * 1.00001F + 1e-7F * all.p_MC.norm();
  return all;
}

/// Bounding spheres of blocks of clusters, sixteen per block; returns their number.
std::uint32_t appendBlockSpheres(std::span<const ShellSphere> clusters, HugeVector<ShellBlock>& to) {
  std::vector<ShellSphere> spheres;
  for (std::size_t c = 0; c < clusters.size(); c += ShellBlock::kLanes)
    spheres.push_back(boundingSphere(clusters.subspan(c, std::min(clusters.size() - c, ShellBlock::kLanes))));
  const std::span<const ShellSphere> all(spheres);
  for (std::size_t i = 0; i < all.size(); i += ShellBlock::kLanes)
    to.push_back(blockOf(all.subspan(i, std::min(all.size() - i, ShellBlock::kLanes))));
  return static_cast<std::uint32_t>(all.size());
}

}  // namespace

Pointshell::Pointshell(const Layout& layout, std::shared_ptr<const void> owner)
    : layout_(layout), owner_(std::move(owner)) {
  if (layout_.points.empty()) return;
  Eigen::AlignedBox3d box;
  for (const ShellPoint& point : layout_.points) box.extend(point.p_MP.cast<double>());
  p_MC_ = box.center();
  for (const ShellPoint& point : layout_.points) {
    const Vector3 p_MP = point.p_MP.cast<double>();
    radius_ = std::max(radius_, p_MP.norm());
    bounding_radius_ = std::max(bounding_radius_, (p_MP - p_MC_).norm());
  }

  auto blocks = std::make_shared<Blocks>();
  for (const ShellSphere& leaf : layout_.leaves) {
    blocks->leaves.push_back(blockOf(layout_.points.subspan(leaf.first, leaf.count)));
  }
  for (std::size_t leaf = 0; leaf < layout_.leaves.size(); ++leaf) {
    blocks->leaf_of_point.insert(blocks->leaf_of_point.end(), layout_.leaves[leaf].count,
                                 static_cast<std::uint32_t>(leaf));
  }
  for (const ShellSphere& cluster : layout_.clusters) {
    blocks->clusters.push_back(blockOf(layout_.leaves.subspan(cluster.first, cluster.count)));
  }
  spheres_ = static_cast<std::uint32_t>(1 + layout_.leaves.size() + layout_.clusters.size());
  for (const ShellLevel& level : layout_.levels) {
    for (std::uint32_t c = 0; c < level.cluster_count; c += ShellBlock::kLanes) {
      const std::size_t count = std::min<std::size_t>(level.cluster_count - c, ShellBlock::kLanes);
      blocks->levels.push_back(blockOf(layout_.clusters.subspan(level.first_cluster + c, count)));
    }
  }
  if (layout_.levels.size() == 1 && blocks->levels.size() >= kManyBlocks)
    spheres_ += appendBlockSpheres(layout_.clusters, blocks->block_spheres);
  blocks->areas = levelAreas(layout_.points, layout_.levels);
  blocks_ = std::move(blocks);
}

}  // namespace tenon::structures
