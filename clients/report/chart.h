#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "clients/report/session_story.h"

namespace tenon {

struct Curve {
  std::string name;
  std::string style;  ///< CSS class of its colour: c1, c2, ...
  const Series* series = nullptr;
  double scale = 1.0;  ///< from SI to the chart's unit
};

struct Band {
  double begin = 0.0, end = 0.0;  ///< [s]
  std::string label;
  std::string title;  ///< shown when pointed at
};

struct Mark {
  double time = 0.0;  ///< [s]
  std::string style;  ///< good, warn or bad
  std::string title;
};

struct Chart {
  std::string title;
  std::string unit;
  std::vector<Curve> curves;
  double limit = 0.0;  ///< a line that should not be crossed; 0 for none
  std::string limit_name;
  double least_top = 1.0;  ///< the axis reaches at least here
  double cut = 0.0;        ///< and at most here, 0 for any height; what is higher is cut off and counted
};

/// Text as it may stand in HTML or SVG.
[[nodiscard]] std::string escaped(std::string_view text);

/// A diagram over session time as an SVG element. Of the values that share a column of pixels the smallest
/// and the largest are drawn, so no peak is lost however long the session was.
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::string drawChart(const Chart& chart, double duration, const std::vector<Band>& bands,
                                    const std::vector<Mark>& marks);

}  // namespace tenon
