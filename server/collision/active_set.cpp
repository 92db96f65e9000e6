#include "server/collision/active_set.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace tenon::collision {
namespace {

/// [-] A row depends on the active rows when its free part, squared and relative to it, is not above this.
constexpr double kMinFree2 = 1e-12;

/// [-] A pivot, squared and relative to its row, below this has lost too many digits by cancellation: the row
/// is then projected instead.
constexpr double kMinPivot2 = 1e-4;

/// Dot product, four at a time: the order of summation depends on the length alone, so results are the same
/// on all processors.
double dotOf(const double* a, const double* b, std::size_t count) {
  Eigen::Array4d sums = Eigen::Array4d::Zero();
  std::size_t i = 0;
  for (; i + 4 <= count; i += 4) {
    sums += Eigen::Map<const Eigen::Array4d>(a + i) * Eigen::Map<const Eigen::Array4d>(b + i);
  }
  double sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
  for (; i < count; ++i) sum += a[i] * b[i];
  return sum;
}

/// y += factor * x
void addScaled(double factor, const double* x, double* y, std::size_t count) {
  std::size_t i = 0;
  for (; i + 4 <= count; i += 4) {
    Eigen::Map<Eigen::Array4d>(y + i) += factor * Eigen::Map<const Eigen::Array4d>(x + i);
  }
  for (; i < count; ++i) y[i] += factor * x[i];
}

}  // namespace

double RowNormal::dot(const RowNormal& other) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < 2; ++i) {
    if (body[i] == kNone) continue;
    for (std::size_t k = 0; k < 2; ++k) {
      if (body[i] == other.body[k]) sum += part[i].dot(other.part[k]);
    }
  }
  return sum;
}

double RowNormal::dot(std::span<const double> all) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < 2; ++i) {
    if (body[i] == kNone) continue;
    sum += part[i].dot(Eigen::Map<const Vector6>(&all[6 * static_cast<std::size_t>(body[i])]));
  }
  return sum;
}

void RowNormal::addTo(std::span<double> all, double factor) const {
  for (std::size_t i = 0; i < 2; ++i) {
    if (body[i] == kNone) continue;
    Eigen::Map<Vector6>(&all[6 * static_cast<std::size_t>(body[i])]) += factor * part[i];
  }
}

ActiveSet::ActiveSet(std::size_t max_variables)
    : L_(max_variables * (max_variables + 1) / 2),
      first_(max_variables),
      normals_(max_variables),
      l_(max_variables),
      r_(max_variables),
      free_(max_variables),
      residual_(max_variables),
      cosine_(max_variables),
      sine_(max_variables) {
  rows_.reserve(max_variables);
}

void ActiveSet::reset(std::size_t variables) {
  assert(variables <= normals_.size());
  n_ = variables;
  rows_.clear();
}

void ActiveSet::solveForward(double* b, std::size_t first) const {
  for (std::size_t i = first; i < size(); ++i) {
    const double* L = line(i);
    const std::size_t from = std::max(first_[i], first);
    b[i] = (b[i] - (from < i ? dotOf(L + from, b + from, i - from) : 0.0)) / L[i];
  }
}

void ActiveSet::solveBackward(double* b) const {
  for (std::size_t i = size(); i-- > 0;) {
    if (b[i] == 0.0) continue;
    const double* L = line(i);
    b[i] /= L[i];
    addScaled(-b[i], L + first_[i], b + first_[i], i - first_[i]);
  }
}

void ActiveSet::solve(std::span<double> b) const {
  solveForward(b.data(), 0);
  solveBackward(b.data());
}

void ActiveSet::projectForward(const RowNormal& normal) {
  projected_ = normal;
  first_coupled_ = size();
  for (std::size_t i = 0; i < size(); ++i) {
    l_[i] = normal.dot(normals_[i]);
    if (l_[i] != 0.0) first_coupled_ = std::min(first_coupled_, i);
  }
  solveForward(l_.data(), first_coupled_);
}

void ActiveSet::project(const RowNormal& normal) {
  projectForward(normal);
  std::copy_n(l_.begin(), size(), r_.begin());
  solveBackward(r_.data());
  const std::span<double> free_part{free_.data(), n_};
  std::fill(free_part.begin(), free_part.end(), 0.0);
  normal.addTo(free_part, 1.0);
  for (std::size_t i = 0; i < size(); ++i) {
    if (r_[i] != 0.0) normals_[i].addTo(free_part, -r_[i]);
  }
  // reorthogonalisation: removes what rounding left of the active normals in the free part
  for (std::size_t i = 0; i < size(); ++i) residual_[i] = normals_[i].dot(free_part);
  solveForward(residual_.data(), 0);
  addScaled(1.0, residual_.data() + first_coupled_, l_.data() + first_coupled_, size() - first_coupled_);
  solveBackward(residual_.data());
  for (std::size_t i = 0; i < size(); ++i) {
    if (residual_[i] == 0.0) continue;
    r_[i] += residual_[i];
    normals_[i].addTo(free_part, -residual_[i]);
  }
  free_norm2_ = dotOf(free_.data(), free_.data(), n_);
}

bool ActiveSet::dependent() const { return size() == n_ || free_norm2_ <= kMinFree2 * projected_.norm2(); }

void ActiveSet::push(std::uint32_t row, double pivot) {
  const std::size_t q = size();
  double* L = line(q);
  first_[q] = first_coupled_;
  std::copy(l_.data() + first_coupled_, l_.data() + q, L + first_coupled_);
  L[q] = pivot;
  normals_[q] = projected_;
  rows_.push_back(row);
}

void ActiveSet::add(std::uint32_t row) { push(row, std::sqrt(free_norm2_)); }

bool ActiveSet::append(std::uint32_t row, const RowNormal& normal) {
  if (size() == n_) return false;
  projectForward(normal);
  const double norm2 = normal.norm2();
  const double pivot2 =
      norm2 - dotOf(l_.data() + first_coupled_, l_.data() + first_coupled_, size() - first_coupled_);
  if (pivot2 > kMinPivot2 * norm2) {
    push(row, std::sqrt(pivot2));
    return true;
  }
  project(normal);
  if (dependent()) return false;
  add(row);
  return true;
}

void ActiveSet::drop(std::size_t position) {
  // Givens rotations restore the triangle: they turn the dropped column into the pivots behind it
  for (std::size_t i = position + 1; i < size(); ++i) {
    const double* from = line(i);
    double* to = line(i - 1);
    const std::size_t first = first_[i];
    double w = first <= position ? from[position] : 0.0;
    if (first < position) std::copy(from + first, from + position, to + first);
    for (std::size_t k = std::max(first, position + 1); k < i; ++k) {
      const double a = from[k];
      to[k - 1] = cosine_[k] * a + sine_[k] * w;
      w = cosine_[k] * w - sine_[k] * a;
    }
    const double pivot = std::sqrt(from[i] * from[i] + w * w);
    cosine_[i] = from[i] / pivot;
    sine_[i] = w / pivot;
    to[i - 1] = pivot;
    first_[i - 1] = first > position ? first - 1 : first;
    normals_[i - 1] = normals_[i];
    rows_[i - 1] = rows_[i];
  }
  rows_.pop_back();
}

}  // namespace tenon::collision
