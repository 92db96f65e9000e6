#include "idl/wire/codec.h"

#include <string>

#include "idl/wire/convert.h"
#include "idl/wire/sample.h"

namespace tenon::wire {

template <class M>
Result<std::vector<std::uint8_t>> encode(const M& message) {
  wire::Wire<M> wire;
  if (const auto good = wire::toWire(message, wire); !good) return tl::unexpected(good.error());
  std::vector<std::uint8_t> bytes;
  wire::encodeSample(wire::TypeOf<M>::descriptor(), &wire.sample, bytes);
  return bytes;
}

template <class M>
Result<M> decode(std::span<const std::uint8_t> bytes) {
  wire::OwnedSample sample(wire::TypeOf<M>::descriptor());
  M message;
  if (!sample.decode(bytes) ||
      !wire::fromWire(*static_cast<const typename wire::TypeOf<M>::C*>(sample.get()), message)) {
    return fail(std::to_string(bytes.size()) + " bytes are not a " + std::string(typeName<M>()));
  }
  return message;
}

template <class M>
std::string_view typeName() {
  return wire::TypeOf<M>::descriptor().m_typename;
}

#define TENON_INSTANTIATE(M)                                      \
  template Result<std::vector<std::uint8_t>> encode<M>(const M&); \
  template Result<M> decode<M>(std::span<const std::uint8_t>);    \
  template std::string_view typeName<M>();
TENON_WIRE_MESSAGES(TENON_INSTANTIATE)
#undef TENON_INSTANTIATE

}  // namespace tenon::wire
