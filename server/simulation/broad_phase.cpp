#include "server/simulation/broad_phase.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace tenon::simulation {

BroadPhase::BroadPhase(const Scene& scene)
    : intervals_(scene.objects.size()),
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
    const auto dilationOf = [&scene](ObjectId object) {
      const auto& structures = scene.objects[object.value].structures;
      return structures ? structures->field.dilation() : 0.0;
    };
    dilations_.push_back(std::max(dilationOf(spec.b), std::min(dilationOf(spec.a), spec.most_dilation_a)));
    largest_dilation_ = std::max(largest_dilation_, dilations_.back());
  }
}

void BroadPhase::setSphere(ObjectId object, const Vector3& p_WC, double radius) noexcept {
  intervals_[object.value].p_WC = p_WC;
  intervals_[object.value].radius = radius;
  intervals_[object.value].present = true;
}

void BroadPhase::remove(ObjectId object) noexcept { intervals_[object.value].present = false; }

std::span<const std::uint32_t> BroadPhase::findPairs(double margin) noexcept {
  found_.clear();
  // [m] covers rounding errors of the sums of coordinates
  constexpr double kRounding = 1e-9;
  const double pad = 0.5 * (margin + largest_dilation_) + kRounding;
  for (Interval& interval : intervals_) {
    interval.low = interval.p_WC.x() - interval.radius - pad;
    interval.high = interval.p_WC.x() + interval.radius + pad;
    if (!interval.present) interval.low = std::numeric_limits<double>::infinity();
  }
  sort();
  for (std::size_t i = 0; i < order_.size() && intervals_[order_[i]].present; ++i) {
    const double high = intervals_[order_[i]].high;
    for (std::size_t j = i + 1; j < order_.size() && intervals_[order_[j]].low <= high; ++j) {
      addPairsOf(order_[i], order_[j], margin);
    }
  }
  std::sort(found_.begin(), found_.end());
  return found_;
}

void BroadPhase::sort() noexcept {
  const auto before = [this](std::uint32_t one, std::uint32_t other) {
    const double low = intervals_[one].low;
    const double other_low = intervals_[other].low;
    return low != other_low ? low < other_low : one < other;
  };
  for (std::size_t i = 1; i < order_.size(); ++i) {
    const std::uint32_t inserted = order_[i];
    std::size_t position = i;
    for (; position > 0 && before(inserted, order_[position - 1]); --position) {
      order_[position] = order_[position - 1];
    }
    order_[position] = inserted;
  }
}

void BroadPhase::addPairsOf(std::uint32_t one, std::uint32_t other, double margin) noexcept {
  std::int32_t pair = firstPair(one, other);
  if (pair == kNone) return;
  const Interval& a = intervals_[one];
  const Interval& b = intervals_[other];
  const double gap = (a.p_WC - b.p_WC).norm() - a.radius - b.radius;
  for (; pair != kNone; pair = next_pair_[static_cast<std::size_t>(pair)]) {
    const auto index = static_cast<std::size_t>(pair);
    if (gap - dilations_[index] <= margin) found_.push_back(static_cast<std::uint32_t>(pair));
  }
}

std::int32_t& BroadPhase::firstPair(std::uint32_t one, std::uint32_t other) {
  return first_pair_[std::min(one, other) * intervals_.size() + std::max(one, other)];
}

}  // namespace tenon::simulation
