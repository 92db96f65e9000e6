#pragma once

#include <filesystem>

namespace tenon::test {

/// Root of the source tree that the tests were built from.
[[nodiscard]] std::filesystem::path sourceFolder();

}  // namespace tenon::test
