#pragma once

#include <algorithm>
#include <span>

#include "server/collision/pair_query.h"
#include "server/structures/pointshell.h"

namespace tenon::collision {

/// The points (in A) of up to sixteen listed contacts, starting with contact `first`, in the kernels' layout.
[[nodiscard]] inline structures::ShellBlock blockOf(const structures::Pointshell& shell,
                                                    std::span<const Contact> contacts, std::size_t first) {
  structures::ShellBlock block;
  block.count = static_cast<std::uint32_t>(std::min(contacts.size() - first, structures::ShellBlock::kLanes));
  for (std::uint32_t i = 0; i < block.count; ++i) {
    const Vector3f& p_AP = shell.points()[contacts[first + i].point].p_MP;
    block.x[i] = p_AP.x();
    block.y[i] = p_AP.y();
    block.z[i] = p_AP.z();
  }
  return block;
}

}  // namespace tenon::collision
