#pragma once

#include <cstdint>
#include <filesystem>

namespace tenon {

/// What the importing child writes into the memory file that its parent gave it: this, then 3 floats a
/// vertex, 3 numbers a triangle, and text (notes, or the reason of a failure).
struct ImportHeader {
  static constexpr std::uint64_t kMagic = 0x544E2D4D45534831ULL;
  std::uint64_t magic = kMagic;
  std::uint64_t failed = 0;
  std::uint64_t vertices = 0;
  std::uint64_t triangles = 0;
  std::uint64_t text_bytes = 0;
};

/// Limits that the child puts on itself before it touches the file.
struct ImportLimits {
  double cpu_seconds = 0.0;        ///< 0: by the size of the file
  std::uint64_t memory_bytes = 0;  ///< 0: by the size of the file
};

/// The child's whole life: `tenon-bake --import-child FILE UNIT CPU_SECONDS MEMORY_BYTES`, result to
/// descriptor 3. Gives the exit code.
int runImportChild(int argc, const char* const* argv);

inline constexpr const char* kImportChildFlag = "--import-child";
inline constexpr int kImportDescriptor = 3;

}  // namespace tenon
