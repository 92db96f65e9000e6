#pragma once

#include <cstdint>

#include "server/collision/pair_query.h"
#include "server/structures/surface_tree.h"

namespace tenon::collision {

/// Limits of the work of a refinement, as deterministic counts: the same on every machine.
struct RefinementBudget {
  std::uint32_t contacts = 128;    ///< at most so many, the deepest first
  std::uint32_t triangles = 8192;  ///< tested for all of them together
};

/// Work done by a refinement.
struct RefinementCounts {
  std::uint32_t contacts = 0;
  std::uint32_t triangles = 0;
};

/// Replaces gap and normal of listed contacts by those of B's mesh where the field's gradient is not of unit
/// length: there, at edges and in corners, interpolation errs by up to half a voxel diagonal. Deepest
/// contacts come first. Where the gradient has unit length the interpolated distance is accurate and stays.
///
/// `surface_B` is the outer surface in the field's frame. Contacts without a triangle within the error bound
/// of the field, and those after the budget is used up, keep the field's values. With `query.sum_penalty` the
/// sum is updated. The query needs a margin of some tenths of a voxel to list points that are inside the mesh
/// and outside the field.
///
/// Threads: pure. Real-time.
RefinementCounts refineContacts(const PairQuery& query, const structures::SurfaceTree& surface_B,
                                const RefinementBudget& budget, PairQueryResult& result) noexcept;

}  // namespace tenon::collision
