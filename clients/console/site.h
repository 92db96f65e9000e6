#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "idl/wire/assets.h"

namespace tenon::console {

/// An answer to a GET request.
struct Answer {
  unsigned status = 200;
  std::string type;  ///< Content-Type
  bool is_immutable = false;
  std::vector<std::uint8_t> body;
};

/// What the gateway serves over HTTP: the files of the page, which are read once at the start, and assets by
/// their names. A path of a request is looked up among them and never becomes a path of the file system.
///
/// Threads: any. Real-time: no.
class Site {
 public:
  /// Reads all files below `page`, which may be missing: then `/` says how to build it.
  Site(const std::filesystem::path& page, wire::AssetStore assets);

  /// `target`: as in the request line, with its query.
  [[nodiscard]] Answer answer(std::string_view target) const;
  [[nodiscard]] bool hasPage() const { return files_.contains("/index.html"); }

 private:
  std::map<std::string, Answer, std::less<>> files_;
  wire::AssetStore assets_;
};

/// The header Content-Security-Policy of all answers: nothing is loaded from elsewhere.
[[nodiscard]] std::string_view contentSecurityPolicy();

/// Whether a request may come from a page of `origin` (the header Origin; empty: not from a browser): pages
/// of this server at `host` (the header Host), and those of `others`.
[[nodiscard]] bool isPermittedOrigin(std::string_view origin, std::string_view host,
                                     const std::vector<std::string>& others);
/// Whether the header Host names this machine's loopback interface: a name that somebody else's DNS server
/// points here does not.
[[nodiscard]] bool isLoopbackHost(std::string_view host);

}  // namespace tenon::console
