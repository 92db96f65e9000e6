#include "idl/types/cache_folder.h"

#include <cstdlib>

namespace tenon {

namespace fs = std::filesystem;

namespace {

/// Empty when the variable is not set.
fs::path folderIn(const char* variable) {
  const char* const folder = std::getenv(variable);
  return folder != nullptr ? folder : "";
}

}  // namespace

fs::path defaultCache() {
  if (fs::path cache = folderIn("TENON_CACHE"); !cache.empty()) return cache;
  if (const fs::path cache = folderIn("XDG_CACHE_HOME"); !cache.empty()) return cache / "tenon";
  if (const fs::path home = folderIn("HOME"); !home.empty()) return home / ".cache" / "tenon";
  return fs::temp_directory_path() / "tenon";
}

}  // namespace tenon
