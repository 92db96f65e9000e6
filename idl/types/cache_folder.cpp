#include "idl/types/cache_folder.h"

#include <cstdlib>

namespace tenon {

namespace fs = std::filesystem;

fs::path defaultCache() {
  if (const char* cache = std::getenv("TENON_CACHE")) return cache;
  if (const char* cache = std::getenv("XDG_CACHE_HOME")) return fs::path(cache) / "tenon";
  if (const char* home = std::getenv("HOME")) return fs::path(home) / ".cache" / "tenon";
  return fs::temp_directory_path() / "tenon";
}

}  // namespace tenon
