#pragma once

#include <algorithm>

#include "server/collision/pair_query.h"
#include "server/structures/pointshell.h"

namespace tenon {

/// The points of up to sixteen listed contacts, from number `first`, as kernels read them.
[[nodiscard]] inline ShellBlock blockOf(const Pointshell& shell, const ContactList& contacts,
                                        std::size_t first) {
  ShellBlock block;
  block.count = static_cast<std::uint32_t>(std::min(contacts.size() - first, ShellBlock::kLanes));
  for (std::uint32_t i = 0; i < block.count; ++i) {
    const Vector3f& p_AP = shell.points()[contacts[first + i].point].p_MP;
    block.x[i] = p_AP.x();
    block.y[i] = p_AP.y();
    block.z[i] = p_AP.z();
  }
  return block;
}

}  // namespace tenon
