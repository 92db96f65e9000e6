#pragma once

#include <span>

#include "server/structures/pointshell.h"

namespace tenon {

/// A surface point before it has a place in a tree.
struct ShellSite {
  Vector3 p_MP = Vector3::Zero();
  Vector3 inward_M = Vector3::UnitZ();
  double area = 0.0;  ///< [m^2] of surface it stands for
};

/// Sorts sites into levels and builds the point-sphere tree over each (paper §3.1).
///
/// Level 0 keeps sites at least 2^k spacings apart, every next level halves that, the last takes all the
/// rest: each prefix of levels samples the whole object. Sites that look opposite ways (two sides of a thin
/// plate) do not crowd each other out. Earlier sites win, so callers put corners and edges first. `spacing`
/// [m] of the whole set; 0: the square root of the mean area.
[[nodiscard]] Pointshell buildShell(std::span<const ShellSite> sites, double spacing = 0.0);

}  // namespace tenon
