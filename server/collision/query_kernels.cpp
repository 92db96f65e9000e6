#include "server/collision/query_kernels.h"

#include <algorithm>
#include <atomic>
#include <vector>

// this file is compiled once for every instruction set
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/collision/query_kernels.cpp"
// without the imitated vectors the baseline is one lane, which is faster
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_EMU128)
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "server/collision/bend_lanes_inl.h"
#include "server/collision/contact_lanes_inl.h"
#include "server/collision/cull_lanes_inl.h"
#include "server/collision/sample_lanes_inl.h"

HWY_BEFORE_NAMESPACE();
namespace tenon {
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
  return {nameOfIsa(),     cull::clusters, cull::candidates, exact::samples,
          exact::contacts, exact::pushes,  exact::bent,      exact::planes};
}

}  // namespace HWY_NAMESPACE
}  // namespace tenon
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tenon {
namespace {

HWY_EXPORT(kernels);

struct Supported {
  std::array<QueryKernels, 8> all{};
  std::size_t count = 0;
  std::atomic<std::size_t> chosen = 0;

  Supported() {
    all[count++] = HWY_STATIC_DISPATCH(kernels)();
    // a target is a bit, the best has the lowest
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

Supported supported;

float highest(const std::array<float, 3>& values) {
  return std::max({std::abs(values[0]), std::abs(values[1]), std::abs(values[2])});
}

}  // namespace

CullFrame::CullFrame(const DistanceField& field, const Matrix3& R_BA, const Vector3& p_BA_B, double reach_A,
                     double limit_B) {
  const DistanceField::Layout& layout = field.layout();
  const double per = 1.0 / layout.voxel;
  for (std::size_t i = 0; i < R.size(); ++i) R[i] = static_cast<float>(R_BA.data()[i] * per);
  bool too_long = false;
  for (int axis = 0; axis < 3; ++axis) {
    const auto k = static_cast<std::size_t>(axis);
    p[k] = static_cast<float>((p_BA_B[axis] - layout.p_MoFo_M[axis]) * per - 0.5);
    most[k] = static_cast<float>(layout.bricks[k]) * DistanceField::kBrickVoxels - 1.0F;
    too_long = too_long || most[k] >= static_cast<float>(kMostVoxels);
  }
  per_metre = static_cast<float>(per);
  // a place is a sum of four products, each off by 2^-23 of at most this much; bounds are off by as little
  const float largest = highest(p) + highest(most) + static_cast<float>(2.0 * reach_A * per);
  slack = 4e-6F * largest + 2e-3F;
  limit = static_cast<float>(limit_B * per) + slack;
  outside = static_cast<float>(layout.margin * per);
  beyond_band = std::min(outside, static_cast<float>(layout.band * per - DistanceField::kHalfDiagonal));
  if (too_long) {
    limit = std::numeric_limits<float>::infinity();
    most.fill(0.0F);
  }
}

LaneFrame::LaneFrame(const DistanceField& the_field, const Pose& X_WA, const Pose& X_WB, double the_dilation,
                     double the_margin, double reach_A)
    : field(the_field),
      box_B(the_field.box()),
      dilation(the_dilation),
      margin(the_margin),
      R_WA(X_WA.matrix()),
      R_WB(X_WB.matrix()),
      R_BA((X_WB.rotation().conjugate() * X_WA.rotation()).normalized().toRotationMatrix()),
      p_WA(X_WA.translation()),
      p_BA_B(X_WB.inverse() * X_WA.translation()),
      cull(the_field, R_BA, p_BA_B, reach_A, the_dilation + the_margin) {}

std::span<const QueryKernels> supportedKernels() noexcept { return {supported.all.data(), supported.count}; }

const QueryKernels& chosenKernels() noexcept {
  return supported.all[supported.chosen.load(std::memory_order_relaxed)];
}

bool chooseKernels(std::string_view isa) noexcept {
  for (std::size_t i = 0; i < supported.count; ++i) {
    if (supported.all[i].isa != isa) continue;
    supported.chosen.store(i, std::memory_order_relaxed);
    return true;
  }
  return false;
}

}  // namespace tenon
#endif  // HWY_ONCE
