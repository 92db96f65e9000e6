#pragma once

#include <cstdint>

#include "server/collision/pair_query.h"
#include "server/structures/surface_tree.h"

namespace tenon {

/// Work that a refinement may do, counted: the same on every machine.
struct RefinementBudget {
  std::uint32_t contacts = 128;    ///< the deepest so many
  std::uint32_t triangles = 8192;  ///< looked at for all of them together
};

struct RefinementCounts {
  std::uint32_t contacts = 0;
  std::uint32_t triangles = 0;
};

/// Gives listed contacts the distance and normal of B's mesh where the field bends: there, at edges and in
/// corners, interpolation is off by up to half the diagonal of a voxel. The deepest come first. Where the
/// field's slope is one it is a distance already, and stays.
///
/// `surface_B` is the outer surface, in the field's frame. What has no triangle as near as the field allows
/// for keeps the field's answer. With `query.sum` the sum follows. So that a query also lists points which
/// are inside the mesh and outside the field, ask with a margin of some tenths of a voxel.
///
/// Threads: pure. Real-time.
RefinementCounts refineContacts(const PairQuery& query, const SurfaceTree& surface_B,
                                const RefinementBudget& budget, PairQueryResult& result) noexcept;

}  // namespace tenon
