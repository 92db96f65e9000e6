#include "server/check/open_surface.h"

#include <fmt/format.h>

namespace tenon::check {

void checkOpenSurfaces(CheckedScene& checked) {
  constexpr double kLeastShare = 1e-4;  // [-] of the surface: less is noise of the measurement
  for (std::size_t i = 0; i < checked.scene.objects.size(); ++i) {
    const auto& structures = checked.scene.objects[i].structures;
    if (!structures || structures->info.open_area <= kLeastShare * structures->info.surface_area) continue;
    const game_control::ScenarioObject& object = checked.scenario.objects[i];
    Finding finding{.kind = FindingKind::kOpen, .severity = Severity::kWarning};
    finding.object = ObjectId{static_cast<std::uint32_t>(i)};
    finding.line = object.line;
    finding.value = structures->info.open_area / structures->info.surface_area;
    finding.text = fmt::format("{} of the surface of {} is open: a part could pass walls there",
                               inPercent(finding.value), checked.titleOf(finding.object));
    finding.hint = fmt::format("voxels finer than {}, or a box in 'refine' around its thin walls",
                               inMillimetres(structures->field.voxel()));
    checked.findings.push_back(std::move(finding));
  }
}

}  // namespace tenon::check
