#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.h"

namespace tenon {

/// That a key of a topic ended: an object removed, a client gone.
///
/// MCAP knows messages alone, so a recording keeps disposals on a channel of their own; without them a replay
/// would show for ever what has left the session.
///
/// Threads: any. Real-time: no.
struct InstanceGone {
  std::string topic;
  std::vector<std::uint8_t> key_sample;  ///< a sample of the topic with only its key fields set, as encoded
};

inline constexpr std::string_view kInstanceStateTopic = "__instance_state";
inline constexpr std::string_view kInstanceStateType = "tenon_record::InstanceGone";
/// The schema of that channel.
inline constexpr std::string_view kInstanceStateIdl =
    "module tenon_record {\n"
    "@final struct InstanceGone { string topic; sequence<octet> key_sample; };\n"
    "};\n";

/// As CDR, encapsulation included; written by hand because this room knows no DDS.
[[nodiscard]] std::vector<std::uint8_t> encodeInstanceGone(const InstanceGone& gone);
[[nodiscard]] Result<InstanceGone> decodeInstanceGone(std::span<const std::uint8_t> bytes);

}  // namespace tenon
