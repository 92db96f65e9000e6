#pragma once

#include <memory>
#include <string>
#include <vector>

#include "idl/types/spatial.h"
#include "server/bake/bake.h"

namespace tenon::bench {

/// Another collision engine, for the contacts of the same two meshes.
///
/// Threads: one at a time. Real-time: no.
class ReferenceEngine {
 public:
  virtual ~ReferenceEngine() = default;
  [[nodiscard]] virtual std::string name() const = 0;
  /// Number of contacts at X_BA (pose of mesh A in mesh B).
  virtual std::size_t contacts(const Pose& X_BA) = 0;
};

/// Engines packaged by Debian that handle two triangle meshes of this size: FCL (OBBRSS hierarchies; all
/// contacts, and the first only) and Bullet (GImpact).
[[nodiscard]] std::vector<std::unique_ptr<ReferenceEngine>> referenceEngines(
    const bake::TriangleMesh& mesh_A, const bake::TriangleMesh& mesh_B);

}  // namespace tenon::bench
