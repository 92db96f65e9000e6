#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "clients/report/session_analysis.h"

namespace tenon::report {

/// One line of a chart.
struct ChartCurve {
  std::string name;
  std::string style;               ///< CSS class of its colour: c1 to c4
  const Series* series = nullptr;  ///< must outlive the chart
  double scale = 1.0;              ///< [-] from SI to the chart's unit
};

/// A stretch of time with a label, as one step.
struct ChartBand {
  double begin = 0.0, end = 0.0;  ///< [s]
  std::string label;
  std::string title;  ///< tooltip
};

/// A dot at an event.
struct ChartMark {
  double time = 0.0;  ///< [s]
  std::string style;  ///< CSS class: good, warn or bad
  std::string title;  ///< tooltip
};

/// Lines over session time with one value axis, which begins at 0.
struct Chart {
  std::string title;
  std::string unit;
  std::vector<ChartCurve> curves;
  double limit = 0.0;  ///< [unit] drawn as a dashed line; 0: none
  std::string limit_name;
  double least_top = 1.0;  ///< [unit] the axis reaches at least to here
  double cut = 0.0;        ///< [unit] and at most to here; 0: no bound. Higher values are clipped and counted
};

/// Escapes text for HTML and SVG.
[[nodiscard]] std::string escaped(std::string_view text);

/// Draws a chart of `duration` [s] as an SVG element. Of the values in one column of pixels the smallest and
/// the largest are drawn, so no peak is lost in long sessions.
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::string drawChart(const Chart& chart, double duration, const std::vector<ChartBand>& bands,
                                    const std::vector<ChartMark>& marks);

}  // namespace tenon::report
