// Whether this is a build with AddressSanitizer, which is some ten times slower: tests that repeat
// one thing over many recordings take a part of them there. The release build takes all.
#pragma once

namespace sixpoint::tests {

#if defined(__SANITIZE_ADDRESS__)
inline constexpr bool kSanitized = true;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace sixpoint::tests
