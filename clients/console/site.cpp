#include "clients/console/site.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <utility>

namespace tenon::console {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kAssets = "/assets/";
constexpr std::string_view kBuiltFiles = "/page/";  ///< have a hash of their content in their names

std::string_view typeOf(const fs::path& file) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 8> kTypes{
      {{".html", "text/html; charset=utf-8"},
       {".js", "text/javascript; charset=utf-8"},
       {".css", "text/css; charset=utf-8"},
       {".json", "application/json"},
       {".svg", "image/svg+xml"},
       {".wasm", "application/wasm"},
       {".txt", "text/plain; charset=utf-8"},
       {".png", "image/png"}}};
  const std::string extension = file.extension().string();
  for (const auto& [known, type] : kTypes)
    if (extension == known) return type;
  return "application/octet-stream";
}

Answer text(unsigned status, std::string_view type, std::string_view body) {
  return {status, std::string(type), false, {body.begin(), body.end()}};
}

constexpr std::string_view kNoPage =
    "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Tenon: no page</title>"
    "<h1>The console's page is not built</h1><p>The gateway runs, and viewers of the Foxglove WebSocket "
    "protocol can connect to it. The page is built with Node 18 or newer; install it and build again:</p>"
    "<pre>deploy/setup console\ncmake --preset release\ncmake --build --preset release --target "
    "console_page</pre></html>";

/// What is read first of the bytes of an asset: a binary glTF file, or a list.
std::string_view typeOfAsset(const std::vector<std::uint8_t>& bytes) {
  constexpr std::string_view kMagic = "glTF";
  const bool is_model =
      bytes.size() >= kMagic.size() && std::equal(kMagic.begin(), kMagic.end(), bytes.begin());
  return is_model ? "model/gltf-binary" : "application/json";
}

}  // namespace

Site::Site(const fs::path& page, wire::AssetStore assets) : assets_(std::move(assets)) {
  std::error_code error;
  for (fs::recursive_directory_iterator entry(page, error), end; !error && entry != end;
       entry.increment(error)) {
    if (!entry->is_regular_file()) continue;
    std::ifstream in(entry->path(), std::ios::binary);
    Answer file{200, std::string(typeOf(entry->path())), false, {}};
    file.body.assign(std::istreambuf_iterator<char>(in), {});
    const std::string path = "/" + entry->path().lexically_relative(page).generic_string();
    file.is_immutable = path.starts_with(kBuiltFiles);
    files_.emplace(path, std::move(file));
  }
}

Answer Site::answer(std::string_view target) const {
  const std::string_view path = target.substr(0, target.find_first_of("?#"));
  if (path.starts_with(kAssets)) {
    auto bytes = assets_.get(path.substr(kAssets.size()));
    if (!bytes) return text(404, "text/plain; charset=utf-8", "there is no such asset\n");
    const std::string_view type = typeOfAsset(*bytes);
    return {200, std::string(type), true, std::move(*bytes)};
  }
  const auto found = files_.find(path == "/" ? std::string_view("/index.html") : path);
  if (found != files_.end()) return found->second;
  if (path == "/") return text(503, "text/html; charset=utf-8", kNoPage);
  return text(404, "text/plain; charset=utf-8", "there is no such page\n");
}

std::string_view contentSecurityPolicy() {
  // WebAssembly decodes the models; blob: is how the model loader reads what is inside of a file
  return "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; img-src 'self' data: "
         "blob:; "
         "connect-src 'self' blob:; worker-src 'self' blob:; font-src 'self'; base-uri 'none'; form-action "
         "'none'; "
         "frame-ancestors 'none'";
}

bool isPermittedOrigin(std::string_view origin, std::string_view host,
                       const std::vector<std::string>& others) {
  if (origin.empty()) return true;
  if (std::find(others.begin(), others.end(), origin) != others.end()) return true;
  constexpr std::string_view kScheme = "http://";
  return origin.starts_with(kScheme) && origin.substr(kScheme.size()) == host;
}

bool isLoopbackHost(std::string_view host) {
  const std::size_t colon = host.rfind(':');
  const bool has_port = colon != std::string_view::npos && host.find(']', colon) == std::string_view::npos;
  if (has_port) {
    const std::string_view port = host.substr(colon + 1);
    if (port.empty() || !std::all_of(port.begin(), port.end(), [](char c) { return c >= '0' && c <= '9'; }))
      return false;
    host = host.substr(0, colon);
  }
  return host == "localhost" || host == "127.0.0.1" || host == "[::1]";
}

}  // namespace tenon::console
