#pragma once

#include <array>
#include <cstdint>

namespace tenon::wire {

/// The program that wrote a sample: the GUID of its DDS participant, which DDS assigns and a message cannot
/// claim. All zero: unknown, as of a writer that has ended since.
struct Origin {
  std::array<std::uint8_t, 16> guid{};

  [[nodiscard]] bool known() const { return *this != Origin{}; }
  bool operator==(const Origin&) const = default;
};

}  // namespace tenon::wire
