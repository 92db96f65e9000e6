#pragma once

#include <cstdlib>
#include <filesystem>

namespace tenon::test {

/// The folder of test meshes that are not part of the repository (too large, or malformed on purpose):
/// environment variable TENON_SHARED, or `shared` next to the repository. Tests that need it are skipped
/// where it is absent.
[[nodiscard]] inline std::filesystem::path sharedFolder() {
  if (const char* named = std::getenv("TENON_SHARED"); named != nullptr) return named;
  return std::filesystem::path(__FILE__).parent_path().parent_path().parent_path().parent_path() / "shared";
}

}  // namespace tenon::test
