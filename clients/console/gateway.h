#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "clients/console/web_server.h"
#include "idl/types/messages/role.h"
#include "idl/types/result.h"

namespace tenon::console {

struct GatewayOptions {
  std::string session;               ///< its name; empty: all that are announced
  std::filesystem::path recording;   ///< to be played instead; empty: none
  std::filesystem::path recordings;  ///< folder for those that are started at the desk; empty: none are
  std::uint32_t domain = 0;          ///< DDS domain
  WebOptions web;
  std::optional<Role> role;                       ///< that whoever has the printed address may take
  std::filesystem::path key_file;                 ///< of the session's key; empty: the user's
  std::filesystem::path page;                     ///< folder of the built page; may be missing
  std::filesystem::path cache;                    ///< of baked structures and display models, as the server's
  std::function<void(const std::string&)> print;  ///< gets lines for the terminal; any thread
  /// Gets lines of a check of the recording that takes long, for who waits; may be empty.
  std::function<void(const std::string&)> progress;
  std::chrono::milliseconds progress_period{2000};  ///< at least between these lines
};

/// Serves one session, all sessions of a DDS domain, or a recording, to browsers until `stop` is set. Of all
/// sessions it joins those that somebody looks at. Fails when the port cannot be had, DDS cannot be used, or
/// there is no such recording.
///
/// Threads: one, with one more for each session that is followed, each person who has a seat, and the
/// WebServer. Real-time: no.
[[nodiscard]] Result<void> runGateway(const GatewayOptions& options, const std::atomic<bool>& stop);

/// Where the built page lies beside the program that runs: in a build folder, or in an installation.
[[nodiscard]] std::filesystem::path defaultPage();

}  // namespace tenon::console
