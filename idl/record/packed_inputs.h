#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/result.h"

/// Inputs of many ticks in one message of a recording.
namespace tenon::record {

/// The joined parts of one TickInput.
struct RecordedInput {
  Tick tick = 0;
  std::uint64_t state_hash = 0;  ///< of the state after the tick
  std::vector<std::uint8_t> bytes;

  bool operator==(const RecordedInput&) const = default;
};

inline constexpr std::string_view kPackedInputsTopic = "TickInputs";
inline constexpr std::string_view kPackedInputsType = "tenon_record::PackedInputs";
/// The schema of that channel.
inline constexpr std::string_view kPackedInputsIdl =
    "module tenon_record {\n"
    "@final struct PackedInputs { unsigned long long first_tick; unsigned long long last_tick; "
    "sequence<octet> "
    "bytes; };\n"
    "};\n";

/// Lossless. A number of a hand (position, orientation, velocity, count) is kept as the difference of its
/// bits from what the hand's former numbers predict, and these differences byte by byte, number by number, so
/// that a general compressor finds them small. Each number has the predictor that fits it best: the former
/// value, a straight line, or, of a velocity, the difference of positions a tick apart. The bytes are those
/// of server/session/tick_io.cpp; others are kept as they are.
///
/// CDR with encapsulation header.
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::vector<std::uint8_t> encodePackedInputs(std::span<const RecordedInput> inputs);
/// Fails when `bytes` are no complete PackedInputs.
[[nodiscard]] Result<std::vector<RecordedInput>> decodePackedInputs(std::span<const std::uint8_t> bytes);

}  // namespace tenon::record
