#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.h"

namespace tenon::record {

/// The end of a topic's instance (key): disposed, as an object that is removed, or without writers, as a
/// client that has left.
///
/// MCAP has no instance states, so recordings keep them on a channel of their own; without it a replay would
/// show objects and clients that have left the session.
///
/// Threads: any. Real-time: no.
struct InstanceGone {
  std::string topic;
  std::vector<std::uint8_t> key_sample;  ///< encoded sample of the topic with only its key fields set
};

inline constexpr std::string_view kInstanceStateTopic = "__instance_state";
inline constexpr std::string_view kInstanceStateType = "tenon_record::InstanceGone";
/// The schema of that channel.
inline constexpr std::string_view kInstanceStateIdl =
    "module tenon_record {\n"
    "@final struct InstanceGone { string topic; sequence<octet> key_sample; };\n"
    "};\n";

/// CDR with encapsulation header; coded by hand because this folder does not depend on DDS.
[[nodiscard]] std::vector<std::uint8_t> encodeInstanceGone(const InstanceGone& gone);
/// Fails when `bytes` are no complete InstanceGone.
[[nodiscard]] Result<InstanceGone> decodeInstanceGone(std::span<const std::uint8_t> bytes);

}  // namespace tenon::record
