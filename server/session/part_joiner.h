#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/ids.h"

namespace tenon::session {

/// Joins the parts of one tick; parts out of order are dropped. `Part` is TickInputPart or
/// CheckpointPart.
///
/// Threads: one. Real-time: no.
template <typename Part>
class PartJoiner {
 public:
  /// True when `part` was the last one: bytes() are complete.
  bool add(const Part& part) {
    if (part.tick != tick_ || part.part == 0) {
      bytes_.clear();
      next_ = 0;
      tick_ = part.tick;
    }
    if (part.part != next_) return false;
    ++next_;
    bytes_.insert(bytes_.end(), part.bytes.begin(), part.bytes.end());
    return next_ == part.parts;
  }
  [[nodiscard]] std::span<const std::uint8_t> bytes() const { return bytes_; }

 private:
  Tick tick_ = 0;
  std::uint32_t next_ = 0;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace tenon::session
