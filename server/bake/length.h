#pragma once

#include <string_view>

#include "idl/types/result.h"

namespace tenon {

/// A length as a person writes it: `3mm`, `0.5 mm`, `0.003m`, `2 cm`, `1 in`; a bare number is metres.
[[nodiscard]] Result<double> parseLength(std::string_view text);

/// The length of one `mm`, `cm`, `m` or `in` [m].
[[nodiscard]] Result<double> parseUnit(std::string_view text);

}  // namespace tenon
