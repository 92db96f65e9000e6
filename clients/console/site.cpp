#include "clients/console/site.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <fstream>
#include <iterator>
#include <limits>
#include <utility>

namespace tenon::console {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kAssets = "/assets/";
constexpr std::string_view kGateway = "/gateway.json";
constexpr std::string_view kRecording = "/recording.mcap";
constexpr std::string_view kNoAsset = "there is no such asset\n";
constexpr std::string_view kModelMagic = "glTF";
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
  return {status, std::string(type), false, {body.begin(), body.end()}, {}};
}

constexpr std::string_view kNoPage =
    "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Tenon: no page</title>"
    "<h1>The console's page is not built</h1><p>The gateway runs, and viewers of the Foxglove WebSocket "
    "protocol can connect to it. The page is built with Node 18 or newer; install it and build again:</p>"
    "<pre>deploy/setup console\ncmake --preset release\ncmake --build --preset release --target "
    "console_page</pre></html>";

/// By its first bytes: a binary glTF file, or a list.
std::string_view typeOfAsset(const fs::path& file) {
  std::string begin(kModelMagic.size(), '\0');
  std::ifstream(file, std::ios::binary).read(begin.data(), static_cast<std::streamsize>(begin.size()));
  return begin == kModelMagic ? "model/gltf-binary" : "application/json";
}

std::string_view pathOf(std::string_view target) { return target.substr(0, target.find_first_of("?#")); }

/// A range of a file, or all of it.
Answer partOf(const fs::path& file, std::string_view range) {
  std::error_code error;
  const std::uint64_t size = fs::file_size(file, error);
  if (error) return text(404, "text/plain; charset=utf-8", "there is no such file\n");
  const FileRange part = parseRange(range, size);
  Answer answer{part.status, "application/octet-stream", false, {}, {{"Accept-Ranges", "bytes"}}};
  const std::string of_all = "/" + std::to_string(size);
  if (part.status == 416) {
    answer.headers.emplace_back("Content-Range", "bytes *" + of_all);
    return answer;
  }
  answer.part = {file, part.offset, part.size};
  if (part.status == 206)
    answer.headers.emplace_back("Content-Range", "bytes " + std::to_string(part.offset) + "-" +
                                                     std::to_string(part.offset + part.size - 1) + of_all);
  return answer;
}

/// A number of bytes; the largest there is for a larger one, none for other texts.
std::optional<std::uint64_t> bytesOf(std::string_view digits) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  if (digits.empty() || end != digits.data() + digits.size()) return std::nullopt;
  return error == std::errc() ? number : std::numeric_limits<std::uint64_t>::max();
}

}  // namespace

FileRange parseRange(std::string_view range, std::uint64_t size) {
  constexpr std::string_view kUnit = "bytes=";
  const FileRange whole{200, 0, size};
  constexpr FileRange kNothing{416, 0, 0};
  if (!range.starts_with(kUnit)) return whole;
  range.remove_prefix(kUnit.size());
  const std::size_t dash = range.find('-');
  if (dash == std::string_view::npos) return whole;
  const bool has_first = dash > 0, has_last = dash + 1 < range.size();
  const auto first = bytesOf(range.substr(0, dash)), last = bytesOf(range.substr(dash + 1));
  if ((has_first && !first) || (has_last && !last) || (!has_first && !has_last)) return whole;
  if (!has_first) {  // so many at the end
    const std::uint64_t count = std::min(*last, size);
    return count == 0 ? kNothing : FileRange{206, size - count, count};
  }
  if (has_last && *first > *last) return whole;
  if (*first >= size) return kNothing;
  const std::uint64_t end = has_last ? std::min(*last, size - 1) : size - 1;
  return {206, *first, end - *first + 1};
}

std::string roomOf(std::string_view target) {
  const std::string_view path = target.substr(0, target.find_first_of("?#"));
  if (path == kLobbyRoom) return std::string(kLobbyRoom);
  const std::string prefix = std::string(kFirstRoom) + "/";
  if (!path.starts_with(prefix)) return std::string(kFirstRoom);
  std::string room;
  for (std::size_t i = 0; i < path.size(); ++i) {
    unsigned code = 0;
    const bool is_code = path[i] == '%' && i + 2 < path.size() &&
                         std::from_chars(&path[i + 1], &path[i + 1] + 2, code, 16).ptr == &path[i + 1] + 2;
    room += is_code ? static_cast<char>(code) : path[i];
    if (is_code) i += 2;
  }
  return room;
}

Site::Site(const fs::path& page, wire::AssetStore assets) : assets_(std::move(assets)) {
  std::error_code error;
  for (fs::recursive_directory_iterator entry(page, error), end; !error && entry != end;
       entry.increment(error)) {
    if (!entry->is_regular_file()) continue;
    std::ifstream in(entry->path(), std::ios::binary);
    Answer file{200, std::string(typeOf(entry->path())), false, {}, {}};
    file.body.assign(std::istreambuf_iterator<char>(in), {});
    const std::string path = "/" + entry->path().lexically_relative(page).generic_string();
    file.is_immutable = path.starts_with(kBuiltFiles);
    files_.emplace(path, std::move(file));
  }
}

void Site::describe(const std::string& json) {
  files_.insert_or_assign(std::string(kGateway), text(200, "application/json", json));
}

Result<void> Site::serveRecording(const fs::path& file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error) || !std::ifstream(file, std::ios::binary))
    return fail(file.string() + ": " + (error ? error.message() : "is no file that can be read"));
  recording_ = file;
  return {};
}

FileVersion versionOf(const fs::path& file) {
  std::error_code ignored;
  return {fs::file_size(file, ignored), fs::last_write_time(file, ignored)};
}

std::optional<std::string> Site::unchecked(std::string_view target) const {
  const std::string_view path = pathOf(target);
  if (!path.starts_with(kAssets) || !assets_.has(path.substr(kAssets.size()))) return std::nullopt;
  const std::string_view name = path.substr(kAssets.size());
  const auto known = checked_.find(name);
  if (known != checked_.end() && known->second == versionOf(assets_.fileOf(name))) return std::nullopt;
  return std::string(name);
}

void Site::setChecked(const std::string& name, const FileVersion& version) {
  checked_.insert_or_assign(name, version);
}

Answer Site::answer(std::string_view target, std::string_view range) const {
  const std::string_view path = pathOf(target);
  if (path == kRecording && !recording_.empty()) return partOf(recording_, range);
  if (path.starts_with(kAssets)) {
    const std::string_view name = path.substr(kAssets.size());
    if (!assets_.has(name)) return text(404, "text/plain; charset=utf-8", kNoAsset);
    Answer answer = partOf(assets_.fileOf(name), range);
    if (!range.empty() || answer.status != 200) return answer;  // who asks for parts checks the whole
    answer.type = typeOfAsset(assets_.fileOf(name));
    answer.is_immutable = true;
    return answer;
  }
  const auto found = files_.find(path == "/" ? std::string_view("/index.html") : path);
  if (found != files_.end()) return found->second;
  if (path == "/") return text(503, "text/html; charset=utf-8", kNoPage);
  return text(404, "text/plain; charset=utf-8", "there is no such page\n");
}

bool isOrigin(std::string_view text) {
  for (const std::string_view scheme : {"http://", "https://"}) {
    if (!text.starts_with(scheme)) continue;
    const std::string_view host = nameOfHost(text.substr(scheme.size()));
    const auto isOfNames = [](char c) {
      return std::isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '-';
    };
    return !host.empty() && std::all_of(host.begin(), host.end(), isOfNames);
  }
  return false;
}

std::string contentSecurityPolicy(const std::vector<std::string>& recordings_from) {
  std::string others;
  for (const std::string& origin : recordings_from) others += " " + origin;
  // WebAssembly decodes the models; blob: is how the model loader reads what is inside of a file; two
  // recordings beside each other are two frames of this page, and no other page has it in a frame
  return "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; img-src 'self' data: "
         "blob:; connect-src 'self' blob:" +
         others +
         "; worker-src 'self' blob:; font-src 'self'; base-uri 'none'; form-action 'none'; frame-src 'self'; "
         "frame-ancestors 'self'";
}

bool isPermittedOrigin(std::string_view origin, std::string_view host, bool is_secure,
                       const std::vector<std::string>& others) {
  if (origin.empty()) return true;
  if (std::find(others.begin(), others.end(), origin) != others.end()) return true;
  const std::string_view scheme = is_secure ? "https://" : "http://";
  return origin.starts_with(scheme) && origin.substr(scheme.size()) == host;
}

std::string_view nameOfHost(std::string_view host) {
  const std::size_t colon = host.rfind(':');
  const bool has_port = colon != std::string_view::npos && host.find(']', colon) == std::string_view::npos;
  if (has_port) {
    const std::string_view port = host.substr(colon + 1);
    if (port.empty() || !std::all_of(port.begin(), port.end(), [](char c) { return c >= '0' && c <= '9'; }))
      return {};
    host = host.substr(0, colon);
  }
  return host;
}

bool isAddress(std::string_view host) {
  const std::string_view name = nameOfHost(host);
  if (name.starts_with('[') && name.ends_with(']')) return true;  // a name has no brackets
  const auto isOfDigits = [](char c) { return (c >= '0' && c <= '9') || c == '.'; };
  return !name.empty() && std::all_of(name.begin(), name.end(), isOfDigits);
}

bool isHandshakeKey(std::string_view key) {
  constexpr std::size_t kCharacters = 22;     // without the padding
  constexpr std::string_view kLast = "AQgw";  // of the last one only two bits are used
  const auto isOfBase64 = [](char c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '+' || c == '/';
  };
  return key.size() == kCharacters + 2 && key.ends_with("==") &&
         std::all_of(key.begin(), key.begin() + kCharacters, isOfBase64) &&
         kLast.find(key[kCharacters - 1]) != std::string_view::npos;
}

bool isLoopbackHost(std::string_view host) {
  constexpr std::string_view kName = "localhost";
  host = nameOfHost(host);
  // names of hosts have no case
  const auto isSameLetter = [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a - 'A' + 'a' : a) == b; };
  return std::equal(host.begin(), host.end(), kName.begin(), kName.end(), isSameLetter) ||
         host == "127.0.0.1" || host == "[::1]";
}

}  // namespace tenon::console
