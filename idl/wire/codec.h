#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "idl/types/result.h"
#include "idl/wire/topics.h"

namespace tenon::wire {

/// Upper bound of the size of a sample [bytes], encapsulation header included. Larger samples would be
/// fragmented, and Cyclone DDS 0.10.2 loses fragmented reliable samples when datagrams are lost.
inline constexpr std::size_t kMaxSampleBytes = 1300;

/// The serialised form on the wire and in recordings: encapsulation header of four bytes, then XCDR1
/// little-endian. Fails when a text or list is longer than tenon.idl allows; the error names the field.
template <class M>
Result<std::vector<std::uint8_t>> encode(const M& message);

/// Deserialises a message of either byte order. `bytes` may be arbitrary: fails unless they are one complete,
/// valid sample of M.
template <class M>
Result<M> decode(std::span<const std::uint8_t> bytes);

/// The fully scoped name of M's type, as in "tenon::WorldFrame".
template <class M>
std::string_view typeName();

/// The text of idl/tenon.idl, the schema in recordings.
std::string_view idlText();

}  // namespace tenon::wire
