#pragma once

#include <optional>
#include <span>
#include <vector>

#include "idl/types/result.h"
#include "server/bake/air_gaps.h"
#include "server/bake/bake.h"
#include "server/bake/field_size.h"
#include "server/bake/thin_bricks.h"
#include "server/bake/triangle_tree.h"
#include "server/bake/welded_mesh.h"
#include "server/structures/field_builder.h"
#include "server/structures/filled_space.h"
#include "server/structures/triangle.h"

namespace tenon::bake {

class ParallelWork;

struct BakedField {
  structures::FieldStorage storage;           ///< of the field, without dilation
  std::vector<structures::Triangle> surface;  ///< the exposed part of the triangles
  std::optional<TriangleTree> surface_tree;   ///< of these
  std::optional<TriangleTree> mesh_tree;      ///< of all triangles, where those are not all
  std::size_t hidden_triangles = 0;           ///< entirely inside the solid
  std::vector<structures::FilledSpace> filled;
  BrickMarks thin;                   ///< where material may be thin
  std::vector<AirGap> refined_gaps;  ///< as in RefinedBricks
  std::vector<AirGap> coarse_gaps;
};

/// The signed distance field of a mesh, taken as a soup of triangles: magnitudes are exact in the band, signs
/// come from a flood fill from outside. An error when it exceeds the limits (with its size) or is cancelled.
///
/// Threads: one caller; uses several threads inside.
[[nodiscard]] Result<BakedField> bakeField(const WeldedMesh& mesh, const BakeOptions& options,
                                           ParallelWork& work, const FieldLimits& limits = {});

}  // namespace tenon::bake
