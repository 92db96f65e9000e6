#include "server/collision/active_set.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace tenon {

ActiveSet::ActiveSet(std::size_t max_variables)
    : stride_(max_variables), J_(stride_ * stride_), R_(stride_ * stride_), d_(stride_) {
  rows_.reserve(stride_);
}

void ActiveSet::reset(std::size_t variables) {
  assert(variables <= stride_);
  n_ = variables;
  rows_.clear();
  for (std::size_t column = 0; column < n_; ++column) {
    for (std::size_t row = 0; row < n_; ++row) j(row, column) = row == column ? 1.0 : 0.0;
  }
}

void ActiveSet::project(std::span<const double> normal) {
  for (std::size_t column = 0; column < n_; ++column) {
    double sum = 0.0;
    for (std::size_t row = 0; row < n_; ++row) sum += j(row, column) * normal[row];
    d_[column] = sum;
  }
}

double ActiveSet::freePart2() const {
  double sum = 0.0;
  for (std::size_t k = size(); k < n_; ++k) sum += d_[k] * d_[k];
  return sum;
}

void ActiveSet::direction(std::span<double> step) const {
  for (std::size_t row = 0; row < n_; ++row) {
    double sum = 0.0;
    for (std::size_t k = size(); k < n_; ++k) sum += j(row, k) * d_[k];
    step[row] = sum;
  }
}

void ActiveSet::coordinates(std::span<double> coordinates) const {
  for (std::size_t i = size(); i-- > 0;) {
    double sum = d_[i];
    for (std::size_t k = i + 1; k < size(); ++k) sum -= r(i, k) * coordinates[k];
    coordinates[i] = sum / r(i, i);
  }
}

void ActiveSet::turn(std::size_t k, double cosine, double sine) {
  for (std::size_t row = 0; row < n_; ++row) {
    const double a = j(row, k);
    const double b = j(row, k + 1);
    j(row, k) = cosine * a + sine * b;
    j(row, k + 1) = cosine * b - sine * a;
  }
}

void ActiveSet::add(std::uint32_t row) {
  const std::size_t q = size();
  // turn the free columns until only the first of them sees the new row
  for (std::size_t k = n_ - 1; k > q; --k) {
    const double length = std::sqrt(d_[k - 1] * d_[k - 1] + d_[k] * d_[k]);
    if (length == 0.0) continue;
    turn(k - 1, d_[k - 1] / length, d_[k] / length);
    d_[k - 1] = length;
    d_[k] = 0.0;
  }
  for (std::size_t i = 0; i <= q; ++i) r(i, q) = d_[i];
  rows_.push_back(row);
}

void ActiveSet::drop(std::size_t position) {
  const std::size_t last = size() - 1;
  for (std::size_t column = position; column < last; ++column) {
    for (std::size_t row = 0; row <= column + 1; ++row) r(row, column) = r(row, column + 1);
    rows_[column] = rows_[column + 1];
  }
  rows_.pop_back();
  // the triangle has lost a column: turn its sub-diagonal away
  for (std::size_t k = position; k < last; ++k) {
    const double length = std::sqrt(r(k, k) * r(k, k) + r(k + 1, k) * r(k + 1, k));
    if (length == 0.0) continue;
    const double cosine = r(k, k) / length;
    const double sine = r(k + 1, k) / length;
    turn(k, cosine, sine);
    for (std::size_t column = k; column < last; ++column) {
      const double a = r(k, column);
      const double b = r(k + 1, column);
      r(k, column) = cosine * a + sine * b;
      r(k + 1, column) = cosine * b - sine * a;
    }
  }
}

}  // namespace tenon
