#include "clients/report/chart.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace tenon::report {
namespace {

// all in units of the view box, but for kGap
constexpr double kWidth = 1000.0, kHeight = 230.0;
constexpr double kLeft = 52.0, kRight = 988.0, kTop = 46.0, kBottom = 204.0;
constexpr double kGap = 0.5;          // [s] without a value breaks the line
constexpr double kLetterWidth = 5.8;  // mean, to see whether a label fits
constexpr int kColumns = static_cast<int>(kRight - kLeft);

/// Distance of about `count` axis ticks: 1, 2 or 5 times a power of ten.
double tickStep(double range, int count) {
  const double rough = range / count;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * power >= rough) return factor * power;
  return 10.0 * power;
}

struct Axes {
  double duration = 1.0, top = 1.0;
  [[nodiscard]] double x(double time) const {
    return kLeft + (kRight - kLeft) * std::clamp(time / duration, 0.0, 1.0);
  }
  [[nodiscard]] double y(double value) const {
    return kBottom - (kBottom - kTop) * std::clamp(value / top, 0.0, 1.0);
  }
};

Axes axesFor(const Chart& chart, double duration) {
  double highest = std::max(chart.least_top, chart.limit * 1.1);
  for (const ChartCurve& curve : chart.curves)
    for (const SeriesPoint& point : *curve.series) highest = std::max(highest, point.value * curve.scale);
  if (chart.cut > 0.0) highest = std::min(highest, chart.cut);
  const double step = tickStep(highest, 4);
  return {std::max(duration, 1e-3), step * std::ceil(highest / step - 1e-9)};
}

std::string drawBands(const Axes& axes, const std::vector<ChartBand>& bands) {
  std::string svg;
  for (std::size_t i = 0; i < bands.size(); ++i) {
    const double from = axes.x(bands[i].begin), width = std::max(0.0, axes.x(bands[i].end) - from);
    svg += fmt::format(
        "<g><title>{}</title><rect class=\"band{}\" x=\"{:.1f}\" y=\"{}\" width=\"{:.1f}\" height=\"{}\"/>",
        escaped(bands[i].title), i % 2, from, kTop - 18.0, width, kBottom - kTop + 18.0);
    const std::string number = std::to_string(i + 1);
    const std::string full = number + " " + bands[i].label;
    const bool fits = kLetterWidth * static_cast<double>(full.size()) < width;
    if (fits || kLetterWidth * static_cast<double>(number.size()) < width)
      svg += fmt::format("<text class=\"step\" x=\"{:.1f}\" y=\"{}\">{}</text>", from + width / 2.0,
                         kTop - 6.0, escaped(fits ? full : number));
    svg += "</g>";
  }
  return svg;
}

std::string drawGrid(const Axes& axes) {
  std::string svg;
  const double value_step = tickStep(axes.top, 4);
  for (int i = 0; i * value_step <= axes.top * 1.0001; ++i) {
    const double y = axes.y(i * value_step);
    svg += fmt::format("<path class=\"grid\" d=\"M{} {:.1f}H{}\"/>", kLeft, y, kRight);
    svg += fmt::format("<text class=\"tick\" text-anchor=\"end\" x=\"{}\" y=\"{:.1f}\">{:.4g}</text>",
                       kLeft - 7.0, y + 4.0, i * value_step);
  }
  const double time_step = tickStep(axes.duration, 10);
  for (int i = 0; i * time_step <= axes.duration * 1.0001; ++i) {
    const double x = axes.x(i * time_step);
    svg += fmt::format("<path class=\"grid\" d=\"M{:.1f} {}v4\"/>", x, kBottom);
    svg += fmt::format("<text class=\"tick\" text-anchor=\"middle\" x=\"{:.1f}\" y=\"{}\">{:.4g}{}</text>", x,
                       kBottom + 17.0, i * time_step, i == 0 ? " s" : "");
  }
  return svg;
}

std::string drawMarks(const Axes& axes, const std::vector<ChartMark>& marks) {
  std::string svg;
  for (const ChartMark& mark : marks) {
    const double x = axes.x(mark.time);
    svg += fmt::format(
        "<g class=\"mark {0}\"><title>{1}</title><path d=\"M{2:.1f} {3}V{4}\"/>"
        "<circle cx=\"{2:.1f}\" cy=\"{3}\" r=\"3.5\"/></g>",
        mark.style, escaped(fmt::format("{:.1f} s: {}", mark.time, mark.title)), x, kTop, kBottom);
  }
  return svg;
}

std::string drawCurve(const Axes& axes, const ChartCurve& curve) {
  std::string path;
  const Series& series = *curve.series;
  double previous = -1e9;
  for (std::size_t i = 0; i < series.size();) {
    // the two extremes of one column of pixels, the earlier first
    const auto column = static_cast<int>(series[i].time / axes.duration * kColumns);
    std::size_t low = i, high = i, last = i;
    for (; last < series.size() && static_cast<int>(series[last].time / axes.duration * kColumns) == column;
         ++last) {
      if (series[last].value < series[low].value) low = last;
      if (series[last].value > series[high].value) high = last;
    }
    const bool is_new = series[i].time - previous > std::max(kGap, 3.0 * axes.duration / kColumns);
    const double x = axes.x(series[i].time);
    path += fmt::format("{}{:.1f} {:.1f}", is_new ? "M" : "L", x,
                        axes.y(series[std::min(low, high)].value * curve.scale));
    if (low != high) path += fmt::format("V{:.1f}", axes.y(series[std::max(low, high)].value * curve.scale));
    previous = series[last - 1].time;
    i = last;
  }
  return path.empty() ? "" : fmt::format("<path class=\"curve {}\" d=\"{}\"/>", curve.style, path);
}

std::string drawHead(const Chart& chart, const Axes& axes) {
  std::string svg =
      fmt::format("<text class=\"name\" x=\"{}\" y=\"16\">{} <tspan class=\"unit\">[{}]</tspan></text>",
                  kLeft, escaped(chart.title), escaped(chart.unit));
  double x = kRight;
  for (auto curve = chart.curves.rbegin(); curve != chart.curves.rend(); ++curve) {
    std::size_t above = 0;
    double highest = 0.0;
    for (const SeriesPoint& point : *curve->series) {
      highest = std::max(highest, point.value * curve->scale);
      if (point.value * curve->scale > axes.top) ++above;
    }
    std::string name = curve->name;
    if (above > 0) name += fmt::format(" ({} above, up to {:.3g})", above, highest);
    svg += fmt::format("<text class=\"legend\" text-anchor=\"end\" x=\"{:.1f}\" y=\"16\">{}</text>", x,
                       escaped(name));
    x -= kLetterWidth * static_cast<double>(name.size()) + 6.0;
    svg += fmt::format("<path class=\"curve thick {}\" d=\"M{:.1f} 12h-18\"/>", curve->style, x);
    x -= 34.0;
  }
  return svg;
}

}  // namespace

std::string escaped(std::string_view text) {
  std::string safe;
  for (const char letter : text) {
    switch (letter) {
      case '&':
        safe += "&amp;";
        break;
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '"':
        safe += "&quot;";
        break;
      default:
        safe += static_cast<unsigned char>(letter) < ' ' ? ' ' : letter;
    }
  }
  return safe;
}

std::string drawChart(const Chart& chart, double duration, const std::vector<ChartBand>& bands,
                      const std::vector<ChartMark>& marks) {
  const Axes axes = axesFor(chart, duration);
  std::string svg = fmt::format("<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{} over time\">",
                                kWidth, kHeight, escaped(chart.title));
  svg += drawBands(axes, bands) + drawGrid(axes) + drawMarks(axes, marks);
  for (const ChartCurve& curve : chart.curves) svg += drawCurve(axes, curve);
  if (chart.limit > 0.0) {
    const double y = axes.y(chart.limit);
    svg += fmt::format("<path class=\"limit\" d=\"M{} {:.1f}H{}\"/>", kLeft, y, kRight);
    svg += fmt::format("<text class=\"limit\" x=\"{}\" y=\"{:.1f}\">{}</text>", kLeft + 4.0, y - 4.0,
                       escaped(chart.limit_name));
  }
  return svg + drawHead(chart, axes) + "</svg>\n";
}

}  // namespace tenon::report
