#include "idl/wire/codec.h"

#include <string>

#include "idl/types/messages.h"
#include "idl/wire/convert.h"
#include "idl/wire/sample.h"

namespace tenon::wire {

template <class M>
Result<std::vector<std::uint8_t>> encode(const M& message) {
  Wire<M> wire;
  if (const auto good = toWire(message, wire); !good) return tl::unexpected(good.error());
  std::vector<std::uint8_t> bytes;
  encodeSample(TypeOf<M>::descriptor(), &wire.sample, bytes);
  return bytes;
}

template <class M>
Result<M> decode(std::span<const std::uint8_t> bytes) {
  OwnedSample sample(TypeOf<M>::descriptor());
  M message;
  if (!sample.decode(bytes) || !fromWire(*static_cast<const typename TypeOf<M>::C*>(sample.get()), message)) {
    return fail(std::to_string(bytes.size()) + " bytes are not a " + std::string(typeName<M>()));
  }
  return message;
}

template <class M>
std::string_view typeName() {
  return TypeOf<M>::descriptor().m_typename;
}

#define TENON_INSTANTIATE(M)                                      \
  template Result<std::vector<std::uint8_t>> encode<M>(const M&); \
  template Result<M> decode<M>(std::span<const std::uint8_t>);    \
  template std::string_view typeName<M>();
TENON_WIRE_MESSAGES(TENON_INSTANTIATE)
#undef TENON_INSTANTIATE

}  // namespace tenon::wire
