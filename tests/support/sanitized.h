#pragma once

namespace tenon::test {

/// Whether a sanitizer is active, which slows code down by 10 to 20 times: tests of minutes are skipped then.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace tenon::test
