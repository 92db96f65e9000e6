#include "server/check/filled_spaces.h"

#include <algorithm>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "server/structures/filled_space.h"

namespace tenon::check {

void checkFilledSpaces(CheckedScene& checked) {
  constexpr std::size_t kNamed = 3;  // of an object
  for (std::size_t i = 0; i < checked.scene.objects.size(); ++i) {
    const auto& structures = checked.scene.objects[i].structures;
    if (!structures) continue;
    const std::span<const structures::FilledSpace> filled = structures->info.filled;
    const game_control::ScenarioObject& object = checked.scenario.objects[i];
    for (std::size_t k = 0; k < std::min(kNamed, filled.size()); ++k) {
      const Eigen::AlignedBox3d box_O(Vector3f::Map(filled[k].low.data()).cast<double>(),
                                      Vector3f::Map(filled[k].high.data()).cast<double>());
      const Vector3 size = box_O.sizes();
      Finding finding{.kind = FindingKind::kFilled, .severity = Severity::kInfo};
      finding.object = ObjectId{static_cast<std::uint32_t>(i)};
      finding.line = object.line;
      finding.p_WP = object.X_WO * box_O.center();
      finding.value = size.maxCoeff();
      finding.unit = "m";
      finding.text = fmt::format(
          "{} has a void or slot of {} x {} x {} at {} that is solid: it is closed, or too narrow for voxels "
          "of {}",
          checked.titleOf(finding.object), inMillimetres(size.x()), inMillimetres(size.y()),
          inMillimetres(size.z()), pointText(*finding.p_WP), inMillimetres(structures->field.voxel()));
      if (k + 1 == kNamed && filled.size() > kNamed)
        finding.text += fmt::format("; {} more have smaller walls", filled.size() - kNamed);
      checked.findings.push_back(std::move(finding));
    }
  }
}

}  // namespace tenon::check
