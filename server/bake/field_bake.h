#pragma once

#include <span>
#include <vector>

#include "idl/types/result.h"
#include "server/bake/bake.h"
#include "server/structures/triangle.h"

namespace tenon {

class ParallelWork;

struct BakedField {
  DistanceField field;
  std::vector<Triangle> surface;  ///< what the outside touches
  std::size_t hidden_triangles = 0;
};

/// The signed distance field of a soup of triangles, magnitudes exact in the band, signs from a flood.
[[nodiscard]] Result<BakedField> bakeField(std::span<const Triangle> triangles, const BakeOptions& options,
                                           ParallelWork& work);

}  // namespace tenon
