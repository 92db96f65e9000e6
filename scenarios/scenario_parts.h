#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "scenarios/mesh.h"

namespace tenon {

/// One mesh that a scenario makes: its file is `<name>.stl`.
struct ScenarioPart {
  std::string_view name;
  std::string_view what;                      ///< a few words for people
  PartMesh (*make)(double detail) = nullptr;  ///< detail 0..1
};

/// A scenario whose parts this project makes itself.
struct PartSet {
  std::string_view name;
  double default_detail = 0.0;
  std::vector<ScenarioPart> parts;
};

/// Every scenario with parts; adding one is adding a line.
[[nodiscard]] const std::vector<PartSet>& partSets();

[[nodiscard]] PartSet pegAndBoxParts();
[[nodiscard]] PartSet engineBayParts();
[[nodiscard]] PartSet stackingParts();

/// The detail at which all parts together have about `triangles` triangles, the bay being most of them.
[[nodiscard]] double detailFor(const PartSet& set, std::size_t triangles);

}  // namespace tenon
