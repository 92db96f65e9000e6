#include "server/bake/length.h"

#include <array>
#include <charconv>
#include <cmath>
#include <string>
#include <utility>

namespace tenon::bake {

Result<double> parseUnit(std::string_view text) {
  constexpr std::array<std::pair<std::string_view, double>, 5> kUnits{
      {{"um", 1e-6}, {"mm", 1e-3}, {"cm", 1e-2}, {"m", 1.0}, {"in", 0.0254}}};
  for (const auto& [name, metres] : kUnits) {
    if (text == name) return metres;
  }
  return fail("'" + std::string(text) + "' is not a unit of length (um, mm, cm, m, in)");
}

Result<double> parseLength(std::string_view text) {
  double number = 0.0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (problem != std::errc{} || !std::isfinite(number)) {
    return fail("'" + std::string(text) + "' is not a length (like 3mm or 0.003m)");
  }
  std::string_view unit = text.substr(static_cast<std::size_t>(end - text.data()));
  while (!unit.empty() && unit.front() == ' ') unit.remove_prefix(1);
  if (unit.empty()) return number;
  const auto metres = parseUnit(unit);
  if (!metres) return fail("'" + std::string(text) + "' is not a length: " + metres.error().what);
  // dividing gives the double nearest to the decimal value: 3 mm equals 0.003 m exactly
  return *metres < 1.0 && unit != "in" ? number / std::round(1.0 / *metres) : number * *metres;
}

}  // namespace tenon::bake
