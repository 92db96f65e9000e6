#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>

#include "tests/support/source_folder.h"

namespace tenon::test {

/// The meshes that are part of the repository: tests/data, which its README describes.
[[nodiscard]] inline std::filesystem::path dataFolder() { return sourceFolder() / "tests" / "data"; }

/// The folder of a larger set of meshes, in the environment variable TENON_SHARED; none when that is not set.
/// Nightly suites run over it beside tests/data: `cad/` holds CAD files, `malformed/` files that are
/// malformed on purpose.
[[nodiscard]] inline std::optional<std::filesystem::path> sharedFolder() {
  const char* named = std::getenv("TENON_SHARED");
  if (named == nullptr || *named == '\0') return {};
  return named;
}

}  // namespace tenon::test
