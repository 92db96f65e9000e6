#pragma once

#include <cstdint>
#include <filesystem>

namespace tenon::bake {

/// Header of the importing child's result in the memory file that its parent provides. It is followed by 3
/// floats [m] per vertex, 3 vertex indices per triangle, a colour (TriangleMesh::colors) per triangle or none
/// at all, and text (the reason of a failure).
struct ImportHeader {
  static constexpr std::uint64_t kMagic = 0x544E2D4D45534832ULL;
  std::uint64_t magic = kMagic;
  std::uint64_t failed = 0;
  std::uint64_t vertices = 0;
  std::uint64_t triangles = 0;
  std::uint64_t colors = 0;  ///< `triangles`, or 0
  std::uint64_t text_bytes = 0;
};

/// Limits that the child sets for itself (setrlimit) before it opens the file; beyond them it is killed, or
/// reports that memory ran out.
struct ImportLimits {
  double cpu_seconds = 0.0;  ///< [s]
  std::uint64_t memory_bytes = 0;
};

/// Main function of the child, `tenon-bake --import-child FILE UNIT CPU_SECONDS MEMORY_BYTES`; writes the
/// result to descriptor 3. Returns an exit code only for wrong arguments, otherwise it ends the process.
int runImportChild(int argc, const char* const* argv);

inline constexpr const char* kImportChildFlag = "--import-child";
inline constexpr int kImportDescriptor = 3;

}  // namespace tenon::bake
