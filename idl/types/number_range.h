#pragma once

#include <functional>
#include <string>

namespace tenon {

/// A check of an option's text: what is wrong with it, or nothing. It is to be a number from `low` to `high`
/// [-]. Other than a comparison with both ends it refuses what is not a number (nan).
[[nodiscard]] std::function<std::string(const std::string&)> numberFrom(double low, double high);

}  // namespace tenon
