#pragma once

#include <array>
#include <cstddef>

#include "tenon.h"
#include <dds/dds.h>

#include "idl/types/result.h"
#include "idl/wire/topics.h"

/// Conversion between the messages of idl/types and the C structs that idlc generates from idl/tenon.idl.
/// Internal to idl/wire, because it includes DDS.
namespace tenon::wire {

template <class M>
struct TypeOf;  ///< `C`: the C struct of message M; descriptor(): its DDS type

#define TENON_TYPE_OF(M)                                                             \
  template <>                                                                        \
  struct TypeOf<M> {                                                                 \
    using C = ::tenon_##M;                                                           \
    static const dds_topic_descriptor_t& descriptor() { return ::tenon_##M##_desc; } \
  };
TENON_WIRE_MESSAGES(TENON_TYPE_OF)
#undef TENON_TYPE_OF

/// The C struct of a message with storage for its sequences, to be reused for each sample. Key strings and
/// octet sequences are not copied: they point into the message, which must outlive the use of the struct.
template <class M>
struct Wire {
  typename TypeOf<M>::C sample{};
  alignas(8) std::array<std::byte, 2048> lists{};
};

/// Fails when a text or list is longer than tenon.idl allows; the error names the field.
template <class M>
Result<void> toWire(const M& message, Wire<M>& wire);

/// False when the sample has values no message can have: too many elements, an unknown enumerator.
template <class M>
bool fromWire(const typename TypeOf<M>::C& sample, M& message);

}  // namespace tenon::wire
