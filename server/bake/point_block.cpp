#include "server/bake/point_block.h"

#include <algorithm>

#include "server/bake/prepared_triangle.h"

#if defined(__x86_64__) && defined(__GNUC__)

#define TENON_LANES_TARGET "avx2"
#define TENON_LANES_BYTES 32
#define TENON_LANES_STRUCT FourPoints
#define TENON_LANES_ANY(mask) __builtin_ia32_movmskpd256((Lanes)(mask))
#include "server/bake/point_lanes_inl.h"
#undef TENON_LANES_TARGET
#undef TENON_LANES_BYTES
#undef TENON_LANES_STRUCT
#undef TENON_LANES_ANY

#define TENON_LANES_TARGET "avx512f,avx512dq"
#define TENON_LANES_BYTES 64
#define TENON_LANES_STRUCT EightPoints
#define TENON_LANES_ANY(mask) __builtin_ia32_cvtq2mask512(mask)
#include "server/bake/point_lanes_inl.h"
#undef TENON_LANES_TARGET
#undef TENON_LANES_BYTES
#undef TENON_LANES_STRUCT
#undef TENON_LANES_ANY

#define TENON_HAS_POINT_LANES
#endif

namespace tenon::bake {

#ifdef TENON_HAS_POINT_LANES

namespace {

enum class Width { kOne, kFour, kEight };

Width widest() {
  if (__builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512dq") != 0) return Width::kEight;
  return __builtin_cpu_supports("avx2") != 0 ? Width::kFour : Width::kOne;
}

}  // namespace

#endif

void PointBlock::add(const Vector3& p, double squared) {
  x_[count_] = p.x();
  y_[count_] = p.y();
  z_[count_] = p.z();
  squared_[count_++] = squared;
}

void PointBlock::finish() {
  largest_ = 0.0;
  for (std::size_t i = 0; i < count_; ++i) largest_ = std::max(largest_, squared_[i]);
  // of lanes that are not used: nothing is nearer
  std::fill(squared_.begin() + static_cast<std::ptrdiff_t>(count_), squared_.end(), 0.0);
}

void PointBlock::lower(const structures::Triangle& t, double slack) {
#ifdef TENON_HAS_POINT_LANES
  static const Width width = widest();
  if (width != Width::kOne) {
    const auto lower_all = width == Width::kEight ? EightPoints::lowerAll : FourPoints::lowerAll;
    largest_ =
        lower_all(PreparedTriangle(t), x_.data(), y_.data(), z_.data(), count_, slack, squared_.data());
    return;
  }
#endif
  const PreparedTriangle prepared(t);
  const auto normal = Vector3::Map(prepared.normal.data());
  largest_ = 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    const double above = normal.dot(point(i) - t[0]);
    const double to_plane = above * above / prepared.squared_normal;
    if (!prepared.has_plane || !(to_plane >= squared_[i] * PreparedTriangle::kPlaneMargin + slack))
      squared_[i] = std::min(squared_[i], structures::squaredDistance(point(i), t));
    largest_ = std::max(largest_, squared_[i]);
  }
}

}  // namespace tenon::bake
