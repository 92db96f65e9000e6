#include "server/collision/active_set.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace tenon {
namespace {

/// A row whose free part is smaller than this share of it (squared) depends on the active rows.
constexpr double kDependent = 1e-12;

/// A pivot (squared) below this share of its row has lost too many digits to be a difference.
constexpr double kCancelled = 1e-4;

/// Sums in an order that depends on nothing but the length, four at a time.
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

/// y += share * x
void addTimes(double share, const double* x, double* y, std::size_t count) {
  std::size_t i = 0;
  for (; i + 4 <= count; i += 4) {
    Eigen::Map<Eigen::Array4d>(y + i) += share * Eigen::Map<const Eigen::Array4d>(x + i);
  }
  for (; i < count; ++i) y[i] += share * x[i];
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

void RowNormal::addTo(std::span<double> all, double share) const {
  for (std::size_t i = 0; i < 2; ++i) {
    if (body[i] == kNone) continue;
    Eigen::Map<Vector6>(&all[6 * static_cast<std::size_t>(body[i])]) += share * part[i];
  }
}

ActiveSet::ActiveSet(std::size_t max_variables)
    : L_(max_variables * (max_variables + 1) / 2),
      first_(max_variables),
      normals_(max_variables),
      l_(max_variables),
      r_(max_variables),
      free_(max_variables),
      rest_(max_variables),
      cosine_(max_variables),
      sine_(max_variables) {
  rows_.reserve(max_variables);
}

void ActiveSet::reset(std::size_t variables) {
  assert(variables <= normals_.size());
  n_ = variables;
  rows_.clear();
}

void ActiveSet::solveLower(double* b, std::size_t first) const {
  for (std::size_t i = first; i < size(); ++i) {
    const double* L = line(i);
    const std::size_t from = std::max(first_[i], first);
    b[i] = (b[i] - (from < i ? dotOf(L + from, b + from, i - from) : 0.0)) / L[i];
  }
}

void ActiveSet::solveUpper(double* b) const {
  for (std::size_t i = size(); i-- > 0;) {
    if (b[i] == 0.0) continue;
    const double* L = line(i);
    b[i] /= L[i];
    addTimes(-b[i], L + first_[i], b + first_[i], i - first_[i]);
  }
}

void ActiveSet::solve(std::span<double> b) const {
  solveLower(b.data(), 0);
  solveUpper(b.data());
}

void ActiveSet::meet(const RowNormal& normal) {
  projected_ = normal;
  meets_from_ = size();
  for (std::size_t i = 0; i < size(); ++i) {
    l_[i] = normal.dot(normals_[i]);
    if (l_[i] != 0.0) meets_from_ = std::min(meets_from_, i);
  }
  solveLower(l_.data(), meets_from_);
}

void ActiveSet::project(const RowNormal& normal) {
  meet(normal);
  std::copy_n(l_.begin(), size(), r_.begin());
  solveUpper(r_.data());
  const std::span<double> free{free_.data(), n_};
  std::fill(free.begin(), free.end(), 0.0);
  normal.addTo(free, 1.0);
  for (std::size_t i = 0; i < size(); ++i) {
    if (r_[i] != 0.0) normals_[i].addTo(free, -r_[i]);
  }
  // once more, for what rounding has left of the active normals in the free part
  for (std::size_t i = 0; i < size(); ++i) rest_[i] = normals_[i].dot(free);
  solveLower(rest_.data(), 0);
  addTimes(1.0, rest_.data() + meets_from_, l_.data() + meets_from_, size() - meets_from_);
  solveUpper(rest_.data());
  for (std::size_t i = 0; i < size(); ++i) {
    if (rest_[i] == 0.0) continue;
    r_[i] += rest_[i];
    normals_[i].addTo(free, -rest_[i]);
  }
  free2_ = dotOf(free_.data(), free_.data(), n_);
}

bool ActiveSet::dependent() const { return size() == n_ || free2_ <= kDependent * projected_.norm2(); }

void ActiveSet::put(std::uint32_t row, double pivot) {
  const std::size_t q = size();
  double* L = line(q);
  first_[q] = meets_from_;
  std::copy(l_.data() + meets_from_, l_.data() + q, L + meets_from_);
  L[q] = pivot;
  normals_[q] = projected_;
  rows_.push_back(row);
}

void ActiveSet::add(std::uint32_t row) { put(row, std::sqrt(free2_)); }

bool ActiveSet::append(std::uint32_t row, const RowNormal& normal) {
  if (size() == n_) return false;
  meet(normal);
  const double norm2 = normal.norm2();
  const double pivot2 = norm2 - dotOf(l_.data() + meets_from_, l_.data() + meets_from_, size() - meets_from_);
  if (pivot2 > kCancelled * norm2) {
    put(row, std::sqrt(pivot2));
    return true;
  }
  project(normal);
  if (dependent()) return false;
  add(row);
  return true;
}

void ActiveSet::drop(std::size_t position) {
  // what the dropped column held of the rows behind it is turned into their own, one after the other
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

}  // namespace tenon
