#pragma once

#include <string_view>

#include "idl/types/result.h"

namespace tenon::bake {

/// [m] A length with its unit: `3mm`, `0.5 mm`, `0.003m`, `2 cm`, `1 in`; a bare number is in metres. Text
/// that is no finite length is an error that quotes it. Threads: pure.
[[nodiscard]] Result<double> parseLength(std::string_view text);

/// [m] The length of one `um`, `mm`, `cm`, `m` or `in`; any other text is an error. Threads: pure.
[[nodiscard]] Result<double> parseUnit(std::string_view text);

}  // namespace tenon::bake
