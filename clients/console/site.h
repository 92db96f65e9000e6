#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "idl/types/result.h"
#include "idl/wire/assets.h"

namespace tenon::console {

/// Bytes of a file, which are read while they are sent.
struct FilePart {
  std::filesystem::path file;
  std::uint64_t offset = 0;  ///< [bytes]
  std::uint64_t size = 0;    ///< [bytes]
};

/// An answer to a GET request.
struct Answer {
  unsigned status = 200;
  std::string type;  ///< Content-Type
  bool is_immutable = false;
  std::vector<std::uint8_t> body;
  std::vector<std::pair<std::string, std::string>> headers;  ///< others
  std::optional<FilePart> part = std::nullopt;               ///< sent instead of `body`
};

/// What the gateway serves over HTTP: the files of the page, which are read once at the start, assets by
/// their names, /gateway.json, which says what this gateway shows, and a recording, by ranges. A path of a
/// request is looked up among them and never becomes a path of the file system.
///
/// Threads: any. Real-time: no.
class Site {
 public:
  /// Reads all files below `page`, which may be missing: then `/` says how to build it.
  Site(const std::filesystem::path& page, wire::AssetStore assets);

  /// For /gateway.json.
  void describe(const std::string& json);
  /// Serves this file as /recording.mcap. Fails when it cannot be read.
  [[nodiscard]] Result<void> serveRecording(const std::filesystem::path& file);

  /// `target`: as in the request line, with its query; `range`: the header Range; `has_body`: not for HEAD,
  /// for which nothing of an asset but its kind is read.
  [[nodiscard]] Answer answer(std::string_view target, std::string_view range = {},
                              bool has_body = true) const;
  [[nodiscard]] bool hasPage() const { return files_.contains("/index.html"); }

 private:
  std::map<std::string, Answer, std::less<>> files_;
  wire::AssetStore assets_;
  std::filesystem::path recording_;  ///< empty: none
};

/// What is sent of a file, by the status of the answer: 206 these bytes, 200 all, 416 nothing, for the range
/// begins behind its end.
struct FileRange {
  unsigned status = 200;
  std::uint64_t offset = 0;  ///< [bytes]
  std::uint64_t size = 0;    ///< [bytes]
};
/// Reads the header Range for a file of `size` [bytes]: "bytes=0-99", both ends inside, "bytes=100-" from
/// there on, and "bytes=-100" the last ones. All is sent for other units, for several ranges, and for other
/// texts.
[[nodiscard]] FileRange parseRange(std::string_view range, std::uint64_t size);

inline constexpr std::string_view kLobbyRoom = "/lobby";
inline constexpr std::string_view kFirstRoom = "/live";
/// The room that a WebSocket request asks for: "/live/NAME" for the session of that name, "/lobby" for the
/// list of all; any other path is that of public viewers: "/live", what this gateway shows first.
[[nodiscard]] std::string roomOf(std::string_view target);

/// Whether this names a server as a browser does: scheme, host and perhaps a port, as in
/// "https://files.example:8443", and no path.
[[nodiscard]] bool isOrigin(std::string_view text);

/// The header Content-Security-Policy of all answers: nothing is loaded from elsewhere, but recordings from
/// the servers of these origins.
[[nodiscard]] std::string contentSecurityPolicy(const std::vector<std::string>& recordings_from);

/// Whether a request may come from a page of `origin` (the header Origin; empty: not from a browser): pages
/// of this server at `host` (the header Host), by https when `is_secure`, and those of `others`.
[[nodiscard]] bool isPermittedOrigin(std::string_view origin, std::string_view host, bool is_secure,
                                     const std::vector<std::string>& others);
/// The header Host without its port; empty when its port is none.
[[nodiscard]] std::string_view nameOfHost(std::string_view host);
/// Whether the header Host is an address, which no DNS server can point here.
[[nodiscard]] bool isAddress(std::string_view host);
/// Whether the header Host names this machine's loopback interface: a name that somebody else's DNS server
/// points here does not.
[[nodiscard]] bool isLoopbackHost(std::string_view host);

}  // namespace tenon::console
