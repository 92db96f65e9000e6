#pragma once

#include <memory>
#include <string>
#include <vector>

#include "idl/types/spatial.h"
#include "server/bake/bake.h"

namespace tenon::bench {

/// Another engine, asked for the contacts of the same two meshes.
class ReferenceEngine {
 public:
  virtual ~ReferenceEngine() = default;
  [[nodiscard]] virtual std::string name() const = 0;
  /// How many contacts it lists at X_BA (of the shell's body in the field's body).
  virtual std::size_t contacts(const Pose& X_BA) = 0;
};

/// What Debian has that takes two triangle meshes of this size: FCL (OBBRSS trees; all contacts, and the
/// first alone) and Bullet (GImpact).
[[nodiscard]] std::vector<std::unique_ptr<ReferenceEngine>> referenceEngines(const TriangleMesh& mesh_A,
                                                                             const TriangleMesh& mesh_B);

}  // namespace tenon::bench
