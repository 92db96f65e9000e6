#include "server/collision/query_kernels.h"

#include <algorithm>
#include <atomic>
#include <vector>

// Highway compiles this file once for every instruction set
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/collision/query_kernels.cpp"
// without emulated vectors the baseline is scalar code, which is faster
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_EMU128)
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "server/collision/contact_lanes_inl.h"
#include "server/collision/cull_lanes_inl.h"
#include "server/collision/ridge_lanes_inl.h"
#include "server/collision/sample_lanes_inl.h"

HWY_BEFORE_NAMESPACE();
namespace tenon::collision {
namespace HWY_NAMESPACE {

const char* nameOfIsa() {
  switch (HWY_TARGET) {
    case HWY_SSE4:
      return "sse4";
    case HWY_AVX2:
      return "avx2";
    case HWY_AVX3:
      return "avx512";
    case HWY_SCALAR:
      return "scalar";
    default:
      return hwy::TargetName(HWY_TARGET);
  }
}

QueryKernels kernels() {
  return {nameOfIsa(),      cull::clusters,          cull::candidates,
          exact::samples,   exact::nearContacts,     exact::contacts,
          exact::penalties, exact::nonUnitGradients, exact::tangentPlanes};
}

}  // namespace HWY_NAMESPACE
}  // namespace tenon::collision
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tenon::collision {
namespace {

HWY_EXPORT(kernels);

struct KernelRegistry {
  std::array<QueryKernels, 8> all{};
  std::size_t count = 0;
  std::atomic<std::size_t> chosen = 0;

  KernelRegistry() {
    all[count++] = HWY_STATIC_DISPATCH(kernels)();
    // a target is a bit; the fastest target has the lowest one
    std::vector<std::int64_t> targets = hwy::SupportedAndGeneratedTargets();
    for (auto target = targets.rbegin(); target != targets.rend() && count < all.size(); ++target) {
      hwy::SetSupportedTargetsForTest(*target);
      hwy::GetChosenTarget().Update(hwy::SupportedTargets());
      const QueryKernels kernels = HWY_DYNAMIC_DISPATCH(kernels)();
      if (kernels.isa != all[0].isa) all[count++] = kernels;
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    chosen = count - 1;
  }
};

KernelRegistry registry;

float largestMagnitude(const std::array<float, 3>& values) {
  return std::max({std::abs(values[0]), std::abs(values[1]), std::abs(values[2])});
}

}  // namespace

CullFrame::CullFrame(const structures::DistanceField& field, const Matrix3& R_BA, const Vector3& p_BA_B,
                     double reach_A, double limit_B) {
  const structures::DistanceField::Layout& layout = field.layout();
  const double per = 1.0 / layout.voxel;
  for (std::size_t i = 0; i < R.size(); ++i) R[i] = static_cast<float>(R_BA.data()[i] * per);
  bool too_long = false;
  for (int axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<std::size_t>(axis);
    p[k] = static_cast<float>((p_BA_B[axis] - layout.p_MoFo_M[axis]) * per - 0.5);
    last_voxel[k] = static_cast<float>(layout.bricks[k]) * structures::DistanceField::kBrickVoxels - 1.0F;
    too_long = too_long || last_voxel[k] >= static_cast<float>(kMaxVoxels);
  }
  per_metre = static_cast<float>(per);
  // a coordinate is a sum of four terms, each with a rounding error of at most 2^-23 of `largest`; errors of
  // the bounds computed from it are of the same size
  const float largest =
      largestMagnitude(p) + largestMagnitude(last_voxel) + static_cast<float>(2.0 * reach_A * per);
  slack = 4e-6F * largest + 2e-3F;
  limit = static_cast<float>(limit_B * per) + slack;
  outside_grid = static_cast<float>(layout.margin * per);
  slope = std::nextafter(static_cast<float>(layout.slope), 2.0F);
  band = std::nextafter(static_cast<float>((layout.band - layout.dilation) * per), 0.0F);
  beyond_band = std::min(outside_grid, static_cast<float>((layout.band - layout.dilation) * per -
                                                          structures::DistanceField::kHalfDiagonal));
  if (too_long) {
    limit = std::numeric_limits<float>::infinity();
    last_voxel.fill(0.0F);
  }
}

LaneFrame::LaneFrame(const structures::DistanceField& the_field, const Pose& X_WA, const Pose& X_WB,
                     double the_margin, double reach_A)
    : field(the_field),
      box_B(the_field.box()),
      margin(the_margin),
      R_WA(X_WA.matrix()),
      R_WB(X_WB.matrix()),
      R_BA((X_WB.rotation().conjugate() * X_WA.rotation()).normalized().toRotationMatrix()),
      p_WA(X_WA.translation()),
      p_BA_B(X_WB.inverse() * X_WA.translation()),
      cull(the_field, R_BA, p_BA_B, reach_A, the_margin) {}

std::span<const QueryKernels> supportedKernels() noexcept { return {registry.all.data(), registry.count}; }

const QueryKernels& chosenKernels() noexcept {
  return registry.all[registry.chosen.load(std::memory_order_relaxed)];
}

bool chooseKernels(std::string_view isa) noexcept {
  for (std::size_t i = 0; i < registry.count; ++i) {
    if (registry.all[i].isa != isa) continue;
    registry.chosen.store(i, std::memory_order_relaxed);
    return true;
  }
  return false;
}

}  // namespace tenon::collision
#endif  // HWY_ONCE
