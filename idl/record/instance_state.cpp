#include "idl/record/instance_state.h"

#include "idl/record/mcap_format.h"

namespace tenon::record {
namespace {

constexpr std::uint8_t kLittleEndianCdr[4] = {0, 1, 0, 0};
constexpr std::size_t kAlignment = 4;

}  // namespace

std::vector<std::uint8_t> encodeInstanceGone(const InstanceGone& gone) {
  mcap::FieldWriter out;
  out.putBytes(kLittleEndianCdr);
  // the length of a CDR string includes its terminating zero, which is sent
  out.put(static_cast<std::uint32_t>(gone.topic.size() + 1));
  out.putBytes({reinterpret_cast<const std::uint8_t*>(gone.topic.c_str()), gone.topic.size() + 1});
  while (out.bytes.size() % kAlignment != 0) out.put(std::uint8_t{0});
  out.put(static_cast<std::uint32_t>(gone.key_sample.size()));
  out.putBytes(gone.key_sample);
  return std::move(out.bytes);
}

Result<InstanceGone> decodeInstanceGone(std::span<const std::uint8_t> bytes) {
  mcap::FieldReader in(bytes);
  InstanceGone gone;
  in.take(sizeof(kLittleEndianCdr));
  const std::string_view topic = in.text();
  const std::size_t read = bytes.size() - in.rest.size();
  in.take((kAlignment - read % kAlignment) % kAlignment);
  const auto key = in.take(in.get<std::uint32_t>());
  if (!in.ok || topic.empty() || topic.back() != '\0')
    return fail(std::to_string(bytes.size()) + " bytes are not a " + std::string(kInstanceStateType));
  gone.topic = topic.substr(0, topic.size() - 1);
  gone.key_sample.assign(key.begin(), key.end());
  return gone;
}

}  // namespace tenon::record
