#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>

namespace tenon {

/// A vector with a capacity of N elements stored in place. Never allocates.
///
/// Threads: as std::vector. Real-time: everything, as far as copying T is.
template <typename T, std::size_t N>
class FixedVector {
 public:
  FixedVector() = default;
  /// Copies the size() elements only.
  FixedVector(const FixedVector& other) : size_(other.size_) { std::copy_n(other.begin(), size_, begin()); }
  FixedVector& operator=(const FixedVector& other) {
    size_ = other.size_;
    if (this != &other) std::copy_n(other.begin(), size_, begin());
    return *this;
  }
  /// Appends `value`; false, and no change, when full.
  bool push_back(const T& value) {
    if (size_ == N) return false;
    values_[size_++] = value;
    return true;
  }
  /// Appends an element that keeps whatever value its storage has; null when full.
  [[nodiscard]] T* extend() { return size_ == N ? nullptr : &values_[size_++]; }
  void clear() { size_ = 0; }
  /// At most N; added elements keep whatever value their storage has.
  void resize(std::size_t size) {
    assert(size <= N);
    size_ = size;
  }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] bool full() const { return size_ == N; }
  [[nodiscard]] static constexpr std::size_t capacity() { return N; }

  T& operator[](std::size_t i) {
    assert(i < size_);
    return values_[i];
  }
  const T& operator[](std::size_t i) const {
    assert(i < size_);
    return values_[i];
  }
  T& back() { return (*this)[size_ - 1]; }
  T* begin() { return values_.data(); }
  T* end() { return values_.data() + size_; }
  const T* begin() const { return values_.data(); }
  const T* end() const { return values_.data() + size_; }

 private:
  std::array<T, N> values_{};
  std::size_t size_ = 0;
};

}  // namespace tenon
