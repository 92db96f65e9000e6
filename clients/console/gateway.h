#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "clients/console/web_server.h"
#include "idl/types/result.h"

namespace tenon::console {

struct GatewayOptions {
  std::string session;       ///< its name; empty: the first one announced
  std::uint32_t domain = 0;  ///< DDS domain
  WebOptions web;
  std::filesystem::path page;                     ///< folder of the built page; may be missing
  std::filesystem::path cache;                    ///< of baked structures and display models, as the server's
  std::function<void(const std::string&)> print;  ///< gets lines for the terminal
};

/// Serves a session to browsers until `stop` is set: joins it as an observer, once for all viewers, and joins
/// the next one when it ends. Fails when the port cannot be had or DDS cannot be used; a session that is not
/// there yet, refuses or is lost is told to viewers.
///
/// Threads: one, which is the only one that uses DDS; the WebServer has another. Real-time: no.
[[nodiscard]] Result<void> runGateway(const GatewayOptions& options, const std::atomic<bool>& stop);

/// Where the built page lies beside the program that runs: in a build folder, or in an installation.
[[nodiscard]] std::filesystem::path defaultPage();

}  // namespace tenon::console
