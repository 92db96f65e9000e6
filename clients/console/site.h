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

/// What is another where a file was written since.
struct FileVersion {
  std::uint64_t size = 0;  ///< [bytes]
  std::filesystem::file_time_type written;

  bool operator==(const FileVersion&) const = default;
};
[[nodiscard]] FileVersion versionOf(const std::filesystem::path& file);

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
/// Threads: one. Real-time: no.
class Site {
 public:
  /// Reads all files below `page`, which may be missing: then `/` says how to build it.
  Site(const std::filesystem::path& page, wire::AssetStore assets);

  /// For /gateway.json.
  void describe(const std::string& json);
  /// Serves this file as /recording.mcap. Fails when it cannot be read.
  [[nodiscard]] Result<void> serveRecording(const std::filesystem::path& file);

  /// The asset that `target` asks for, of which the content is to be checked before all of it is served: read
  /// and compared with its name (wire::AssetStore::get), in some thread that may wait; none: nothing is.
  [[nodiscard]] std::optional<std::string> unchecked(std::string_view target) const;
  /// Remembers of a file of assets() as it was before its check that its content is right.
  void setChecked(const std::string& name, const FileVersion& version);
  [[nodiscard]] const wire::AssetStore& assets() const { return assets_; }

  /// `target`: as in the request line, with its query; `range`: the header Range. Of files that are not the
  /// page's nothing is read but what kind of asset it is.
  [[nodiscard]] Answer answer(std::string_view target, std::string_view range = {}) const;
  [[nodiscard]] bool hasPage() const { return files_.contains("/index.html"); }

 private:
  std::map<std::string, Answer, std::less<>> files_;
  wire::AssetStore assets_;
  std::map<std::string, FileVersion, std::less<>> checked_;  ///< files of assets whose content is right
  std::filesystem::path recording_;                          ///< empty: none
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
/// Whether this is the Sec-WebSocket-Key of a handshake: 16 bytes in base64 (RFC 6455, section 4.2.1).
[[nodiscard]] bool isHandshakeKey(std::string_view key);

}  // namespace tenon::console
