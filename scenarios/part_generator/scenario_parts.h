#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "scenarios/part_generator/mesh.h"

namespace tenon::part_generator {

/// One generated mesh of a scenario: its file is `<name>.stl`.
struct ScenarioPart {
  std::string_view name;
  std::string_view description;               ///< in lists
  PartMesh (*make)(double detail) = nullptr;  ///< `detail` [-] 0 to 1, see MeshBuilder
};

/// The generated parts of a scenario.
struct PartSet {
  std::string_view name;
  double default_detail = 0.0;  ///< [-]
  std::vector<ScenarioPart> parts;
};

/// All scenarios with generated parts.
[[nodiscard]] const std::vector<PartSet>& partSets();

[[nodiscard]] PartSet pegAndBoxParts();
[[nodiscard]] PartSet engineBayParts();
[[nodiscard]] PartSet stackingParts();

/// The detail [-] at which all parts together have about `triangles` triangles, by bisection to 1/256.
[[nodiscard]] double detailFor(const PartSet& set, std::size_t triangles);

}  // namespace tenon::part_generator
