#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "idl/types/spatial.h"

namespace tenon {

/// Running 64-bit hash of a simulation state (FNV-1a over 64-bit words, with a shift in between). Equal
/// states have equal hashes; not cryptographic. The order of add() matters.
class StateHash {
 public:
  void add(std::uint64_t word) {
    value_ = (value_ ^ word) * 0x100000001B3ULL;
    value_ ^= value_ >> 29U;
  }
  /// Of the bits of `number` [-]: 0.0 and -0.0 differ.
  void add(double number) { add(std::bit_cast<std::uint64_t>(number)); }
  void add(const Vector3& v) {
    for (int i = 0; i < 3; ++i) add(v[i]);
  }
  void add(const Pose& X) {
    add(X.translation());
    for (int i = 0; i < 4; ++i) add(X.rotation().coeffs()[i]);
  }
  void add(std::string_view text) {
    for (const char letter : text) add(std::uint64_t{static_cast<unsigned char>(letter)});
    add(std::uint64_t{text.size()});
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xCBF29CE484222325ULL;
};

}  // namespace tenon
