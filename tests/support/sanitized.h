#pragma once

namespace tenon::test {

/// Under a sanitizer everything takes ten to twenty times as long: tests of minutes stay out.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace tenon::test
