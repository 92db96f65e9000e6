#pragma once

#include <compare>
#include <cstdint>
#include <functional>

namespace tenon {

/// An integer id with a type of its own. ObjectId and HandId are indices into the scene; ClientId is assigned
/// by the server and starts at 1. The default is invalid.
template <typename Tag>
struct Id {
  std::uint32_t value = kNone;

  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  [[nodiscard]] constexpr bool valid() const { return value != kNone; }
  constexpr auto operator<=>(const Id&) const = default;
};

using ObjectId = Id<struct ObjectTag>;
using HandId = Id<struct HandTag>;
using ClientId = Id<struct ClientTag>;

/// Number of server ticks since the start of the session. Tick 0 is the state before the first step.
using Tick = std::uint64_t;
inline constexpr double kTickSeconds = 1e-3;  ///< [s]

}  // namespace tenon

template <typename Tag>
struct std::hash<tenon::Id<Tag>> {
  std::size_t operator()(const tenon::Id<Tag>& id) const noexcept { return id.value; }
};
