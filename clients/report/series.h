#pragma once

#include <span>
#include <vector>

#include "idl/types/ids.h"

namespace tenon::report {

/// A value over session time.
struct SeriesPoint {
  double time = 0.0;   ///< [s] since tick 0
  double value = 0.0;  ///< [unit of the series]
};
using Series = std::vector<SeriesPoint>;

[[nodiscard]] inline double secondsOf(Tick tick) { return static_cast<double>(tick) * kTickSeconds; }

/// Appends a point; skips a `value` [unit of the series] that is not finite.
void addPoint(Series& series, Tick tick, double value);

/// Sorts by time, and merges points of equal time to the largest of them.
[[nodiscard]] Series mergedToLargest(Series series);

// of a series that is sorted by time

/// The points from `begin` [s] to `end` [s], both included.
[[nodiscard]] std::span<const SeriesPoint> between(const Series& series, double begin, double end);

/// Largest value from `begin` [s] to `end` [s]; 0 without one.
[[nodiscard]] double peak(const Series& series, double begin, double end);

/// `fraction` [-] of `values` [unit of the series] are at most the result; reorders them. 0 without values.
[[nodiscard]] double percentile(std::vector<double>& values, double fraction);

}  // namespace tenon::report
