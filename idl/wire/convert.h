#pragma once

#include <array>
#include <cstddef>

#include "tenon.h"
#include <dds/dds.h>

#include "idl/types/result.h"
#include "idl/wire/topics.h"

/// Messages as the programs know them, to and from the C structs that idlc made of idl/tenon.idl. Internal to
/// idl/wire: whoever includes this includes DDS.
namespace tenon::wire {

template <class M>
struct TypeOf;  ///< C, the C struct of message M, and descriptor()

#define TENON_TYPE_OF(M)                                                             \
  template <>                                                                        \
  struct TypeOf<M> {                                                                 \
    using C = ::tenon_##M;                                                           \
    static const dds_topic_descriptor_t& descriptor() { return ::tenon_##M##_desc; } \
  };
TENON_WIRE_MESSAGES(TENON_TYPE_OF)
#undef TENON_TYPE_OF

/// The C struct of a message with room for the lists it points to: made once, filled again for each sample.
/// Texts that are keys, and bytes, are not copied: they stay the message's own.
template <class M>
struct Wire {
  typename TypeOf<M>::C sample{};
  alignas(8) std::array<std::byte, 2048> lists{};
};

/// Fails when a text or a list is longer than tenon.idl allows: the sentence names the field.
template <class M>
Result<void> toWire(const M& message, Wire<M>& wire);

/// False when the sample holds what no message can: more elements than fit, a status that does not exist.
template <class M>
bool fromWire(const typename TypeOf<M>::C& sample, M& message);

}  // namespace tenon::wire
