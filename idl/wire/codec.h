#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "idl/types/result.h"
#include "idl/wire/topics.h"

namespace tenon {

/// A sample never has more bytes than this, encapsulation included: larger ones would be sent in fragments,
/// and Cyclone 0.10.2 loses fragmented reliable samples under loss.
inline constexpr std::size_t kMaxSampleBytes = 1300;

/// The message as it is on the wire and in recordings: four bytes of encapsulation, then XCDR1 little-endian.
/// Fails when a text or list is longer than tenon.idl allows.
template <class M>
Result<std::vector<std::uint8_t>> encode(const M& message);

/// The message of such bytes, of either byte order. Any bytes may be given: what is not a whole, valid sample
/// of M is an error.
template <class M>
Result<M> decode(std::span<const std::uint8_t> bytes);

/// The fully scoped name of M's type, as in "tenon::WorldFrame".
template <class M>
std::string_view typeName();

/// The text of idl/tenon.idl: the schema of recordings.
std::string_view idlText();

}  // namespace tenon
