#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "idl/types/result.h"

namespace tenon::wire {

inline constexpr std::size_t kLongestSessionName = 63;  ///< [bytes] of tenon.idl: Join::session

/// Whether a session may have this name, which is a part of DDS partitions and of file names: DDS matches
/// partitions by patterns (* ? [ ] \ as fnmatch), so that one session would hear another, and / begins the
/// partition of a client. Fails with a sentence that names what is permitted.
[[nodiscard]] Result<void> checkSessionName(std::string_view name);

/// Adds `--session` to a program's command line, an instance of CLI11's App.
template <class App>
auto* addSessionOption(App& app, std::string& name, const std::string& description) {
  return app.add_option("--session", name, description)->check([](const std::string& text) {
    const auto permitted = checkSessionName(text);
    return permitted ? std::string() : permitted.error().what;
  });
}

/// Of programs that join a session.
inline constexpr const char* kJoinedSessionHelp = "name of the session; default: the first one announced";

}  // namespace tenon::wire
