#pragma once

#include <cstddef>

/// [bytes] Longest texts of a scenario: the bounds of idl/tenon.idl, beyond which a message could not be
/// sent.
namespace tenon::game_control {

inline constexpr std::size_t kMaxTitle = 127;        // [bytes] of a scenario or an object, in each language
inline constexpr std::size_t kMaxStateTitle = 71;    // [bytes] likewise
inline constexpr std::size_t kMaxInstruction = 223;  // [bytes] in each language
inline constexpr std::size_t kMaxLanguage = 7;       // [bytes] its code
inline constexpr std::size_t kMaxLanguages = 3;      // of a text
inline constexpr std::size_t kMaxObjectName = 63;    // [bytes]
inline constexpr std::size_t kMaxHandName = 31;      // [bytes]
inline constexpr std::size_t kMaxStateName = 47;     // [bytes] and of its part
inline constexpr std::size_t kMaxSignalName = 255;   // [bytes] of an external signal
inline constexpr std::size_t kMaxKind = 31;          // [bytes] of an object

}  // namespace tenon::game_control
