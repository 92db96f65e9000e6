#include "tests/support/source_folder.h"

namespace tenon::test {

// the one file that is compiled with the path, so that all others are the same in every clone
std::filesystem::path sourceFolder() { return TENON_SOURCE; }

}  // namespace tenon::test
