#include "clients/report/series.h"

#include <algorithm>
#include <cmath>

namespace tenon::report {

void addPoint(Series& series, Tick tick, double value) {
  if (std::isfinite(value)) series.push_back({secondsOf(tick), value});
}

Series mergedToLargest(Series series) {
  std::stable_sort(series.begin(), series.end(),
                   [](const SeriesPoint& a, const SeriesPoint& b) { return a.time < b.time; });
  Series merged;
  for (const SeriesPoint& point : series) {
    if (!merged.empty() && merged.back().time == point.time) {
      merged.back().value = std::max(merged.back().value, point.value);
    } else {
      merged.push_back(point);
    }
  }
  return merged;
}

std::span<const SeriesPoint> between(const Series& series, double begin, double end) {
  const auto first =
      std::lower_bound(series.begin(), series.end(), begin,
                       [](const SeriesPoint& point, double time) { return point.time < time; });
  const auto last = std::upper_bound(first, series.end(), end,
                                     [](double time, const SeriesPoint& point) { return time < point.time; });
  return {first, last};
}

double peak(const Series& series, double begin, double end) {
  double highest = 0.0;
  for (const SeriesPoint& point : between(series, begin, end)) highest = std::max(highest, point.value);
  return highest;
}

double percentile(std::vector<double>& values, double fraction) {
  if (values.empty()) return 0.0;
  const auto at = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

}  // namespace tenon::report
