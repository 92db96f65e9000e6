#pragma once

#include <compare>
#include <cstdint>
#include <functional>

namespace tenon {

/// A number that means one kind of thing. Ids of objects and hands are their index in the scene, so they
/// are dense, start at 0 and index arrays directly; client ids are handed out by the server and start at 1.
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

/// A tick of the server: one millisecond. Tick 0 is the state before the first step.
using Tick = std::uint64_t;
inline constexpr double kTickSeconds = 1e-3;

}  // namespace tenon

template <typename Tag>
struct std::hash<tenon::Id<Tag>> {
  std::size_t operator()(const tenon::Id<Tag>& id) const noexcept { return id.value; }
};
