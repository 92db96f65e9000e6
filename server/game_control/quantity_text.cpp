#include "server/game_control/quantity_text.h"

#include <cmath>

#include <fmt/format.h>

namespace tenon::game_control {

std::string inMillimetres(double metres) {
  // from a tenth of a millimetre on no more exact than a hundredth
  const double mm = std::abs(metres) < 100e-6 ? 1e3 * metres : std::round(1e5 * metres) / 100.0;
  return std::abs(mm) < 9999.5 ? fmt::format("{:.3g} mm", mm) : fmt::format("{:.3g} m", metres);
}

std::string inPercent(double fraction) {
  const double percent = 100.0 * fraction;
  if (percent > 0.0 && percent < 0.001) return "less than 0.001 %";
  // 9.96 with two digits would be 1e+01
  return percent < 9.95 ? fmt::format("{:.2g} %", percent) : fmt::format("{:.0f} %", percent);
}

std::string inDegrees(double radians) { return fmt::format("{:.3g} deg", radians / kDegree); }

std::string pointText(const Vector3& p_W) {
  // 0.0 + -0.0 is 0.0
  const auto tenth = [](double metres) { return std::round(1e4 * metres) / 10.0 + 0.0; };
  return fmt::format("({:g}, {:g}, {:g}) mm", tenth(p_W.x()), tenth(p_W.y()), tenth(p_W.z()));
}

}  // namespace tenon::game_control
