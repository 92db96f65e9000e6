#include "scenarios/part_generator/scenario_parts.h"

#include <numeric>

namespace tenon::part_generator {

const std::vector<PartSet>& partSets() {
  static const std::vector<PartSet> kSets{pegAndBoxParts(), engineBayParts(), stackingParts()};
  return kSets;
}

double detailFor(const PartSet& set, std::size_t triangles) {
  const auto count = [&](double detail) {
    return std::accumulate(
        set.parts.begin(), set.parts.end(), std::size_t{0},
        [&](std::size_t sum, const auto& part) { return sum + part.make(detail).triangles.size(); });
  };
  double low = 0.0;
  double high = 1.0;
  for (int iteration = 0; iteration < 7; ++iteration) {
    const double middle = 0.5 * (low + high);
    (count(middle) < triangles ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace tenon::part_generator
