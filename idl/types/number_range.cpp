#include "idl/types/number_range.h"

#include <cstdio>
#include <cstdlib>

#include "idl/types/printable_text.h"

namespace tenon {

std::function<std::string(const std::string&)> numberFrom(double low, double high) {
  return [low, high](const std::string& text) -> std::string {
    char* end = nullptr;
    const double number = std::strtod(text.c_str(), &end);
    const bool is_number = !text.empty() && end == text.c_str() + text.size();
    if (is_number && number >= low && number <= high) return {};
    char range[64];
    std::snprintf(range, sizeof range, "from %g to %g", low, high);
    return "'" + shortened(printable(text), 40) + "' is not a number " + range;
  };
}

}  // namespace tenon
