#include "server/simulation/broad_phase.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace tenon {

BroadPhase::BroadPhase(const Scene& scene)
    : shadows_(scene.objects.size()),
      order_(scene.objects.size()),
      first_pair_(scene.objects.size() * scene.objects.size(), kNone),
      next_pair_(scene.pairs.size(), kNone) {
  std::iota(order_.begin(), order_.end(), 0U);
  dilations_.reserve(scene.pairs.size());
  found_.reserve(scene.pairs.size());
  for (std::size_t pair = 0; pair < scene.pairs.size(); ++pair) {
    const PairSpec& spec = scene.pairs[pair];
    std::int32_t& first = firstPair(spec.a.value, spec.b.value);
    next_pair_[pair] = first;
    first = static_cast<std::int32_t>(pair);
    dilations_.push_back(spec.dilation);
    largest_dilation_ = std::max(largest_dilation_, spec.dilation);
  }
}

void BroadPhase::place(ObjectId object, const Vector3& p_WC, double radius) noexcept {
  shadows_[object.value].p_WC = p_WC;
  shadows_[object.value].radius = radius;
  shadows_[object.value].there = true;
}

void BroadPhase::hide(ObjectId object) noexcept { shadows_[object.value].there = false; }

std::span<const std::uint32_t> BroadPhase::find(double reach) noexcept {
  found_.clear();
  // what rounding may take from a sum of coordinates is given back
  constexpr double kRounding = 1e-9;
  const double pad = 0.5 * (reach + largest_dilation_) + kRounding;
  for (Shadow& shadow : shadows_) {
    shadow.low = shadow.p_WC.x() - shadow.radius - pad;
    shadow.high = shadow.p_WC.x() + shadow.radius + pad;
    if (!shadow.there) shadow.low = std::numeric_limits<double>::infinity();
  }
  sort();
  for (std::size_t i = 0; i < order_.size() && shadows_[order_[i]].there; ++i) {
    const double high = shadows_[order_[i]].high;
    for (std::size_t j = i + 1; j < order_.size() && shadows_[order_[j]].low <= high; ++j) {
      meet(order_[i], order_[j], reach);
    }
  }
  std::sort(found_.begin(), found_.end());
  return found_;
}

void BroadPhase::sort() noexcept {
  const auto before = [this](std::uint32_t one, std::uint32_t other) {
    const double low = shadows_[one].low;
    const double other_low = shadows_[other].low;
    return low != other_low ? low < other_low : one < other;
  };
  for (std::size_t i = 1; i < order_.size(); ++i) {
    const std::uint32_t moving = order_[i];
    std::size_t place = i;
    for (; place > 0 && before(moving, order_[place - 1]); --place) order_[place] = order_[place - 1];
    order_[place] = moving;
  }
}

void BroadPhase::meet(std::uint32_t one, std::uint32_t other, double reach) noexcept {
  std::int32_t pair = firstPair(one, other);
  if (pair == kNone) return;
  const Shadow& a = shadows_[one];
  const Shadow& b = shadows_[other];
  const double gap = (a.p_WC - b.p_WC).norm() - a.radius - b.radius;
  for (; pair != kNone; pair = next_pair_[static_cast<std::size_t>(pair)]) {
    const auto index = static_cast<std::size_t>(pair);
    if (gap - dilations_[index] <= reach) found_.push_back(static_cast<std::uint32_t>(pair));
  }
}

std::int32_t& BroadPhase::firstPair(std::uint32_t one, std::uint32_t other) {
  return first_pair_[std::min(one, other) * shadows_.size() + std::max(one, other)];
}

}  // namespace tenon
