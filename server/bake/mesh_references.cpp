#include "server/bake/mesh_references.h"

#include <algorithm>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>

namespace tenon::bake {

namespace {

namespace fs = std::filesystem;

/// In lower case.
std::string extensionOf(const fs::path& mesh) {
  std::string extension = mesh.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(c >= 'A' && c <= 'Z' ? c + 32 : c); });
  return extension;
}

/// The material libraries that an OBJ names: one a line, which may have spaces.
std::set<std::string> librariesOf(const std::string& obj) {
  constexpr std::string_view kKey = "mtllib";
  std::set<std::string> names;
  for (std::size_t at = obj.find(kKey); at != std::string::npos; at = obj.find(kKey, at + 1)) {
    if (at > 0 && obj[at - 1] != '\n' && obj[at - 1] != '\r') continue;
    const std::size_t first = obj.find_first_not_of(" \t", at + kKey.size());
    if (first == std::string::npos || first == at + kKey.size()) continue;
    const std::size_t end = std::min(obj.find_first_of("\r\n", first), obj.size());
    const std::size_t last = obj.find_last_not_of(" \t", end - 1);
    const std::string name = obj.substr(first, last + 1 - first);
    if (end > first && name.find('\0') == std::string::npos) names.insert(name);
  }
  return names;
}

std::optional<unsigned> hexadecimal(const std::string& text, std::size_t at, std::size_t digits) {
  unsigned value = 0;
  if (at + digits > text.size()) return {};
  for (std::size_t i = at; i < at + digits; ++i) {
    const char c = text[i];
    const int digit = c >= '0' && c <= '9'   ? c - '0'
                      : c >= 'a' && c <= 'f' ? c - 'a' + 10
                      : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                             : -1;
    if (digit < 0) return {};
    value = 16 * value + static_cast<unsigned>(digit);
  }
  return value;
}

void appendUtf8(unsigned code, std::string& text) {
  const auto put = [&text](unsigned byte) { text.push_back(static_cast<char>(byte)); };
  if (code < 0x80U) return put(code);
  if (code < 0x800U) {
    put(0xC0U | code >> 6U);
  } else {
    put(0xE0U | code >> 12U);
    put(0x80U | (code >> 6U & 0x3FU));
  }
  put(0x80U | (code & 0x3FU));
}

/// The JSON string that begins behind the quote before `at`; empty when it does not end.
std::string jsonString(const std::string& json, std::size_t at) {
  std::string text;
  for (; at < json.size() && json[at] != '"'; ++at) {
    if (json[at] != '\\' || at + 1 >= json.size()) {
      text.push_back(json[at]);
      continue;
    }
    const char escaped = json[++at];
    if (escaped == 'u') {
      const auto code = hexadecimal(json, at + 1, 4);
      if (!code) return {};
      appendUtf8(*code, text);
      at += 4;
    } else {
      text.push_back(escaped == 'n' ? '\n' : escaped == 't' ? '\t' : escaped);
    }
  }
  return at < json.size() ? text : std::string();
}

std::string percentDecoded(const std::string& uri) {
  std::string text;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const auto code = uri[i] == '%' ? hexadecimal(uri, i + 1, 2) : std::nullopt;
    text.push_back(code ? static_cast<char>(*code) : uri[i]);
    if (code) i += 2;
  }
  return text;
}

/// What `uri` keys name, but not data in the text itself; sorted, each once.
std::set<std::string> urisOf(const std::string& json) {
  constexpr std::string_view kKey = "\"uri\"";
  constexpr std::string_view kSpace = " \t\r\n";
  std::set<std::string> uris;
  for (std::size_t at = json.find(kKey); at != std::string::npos; at = json.find(kKey, at + 1)) {
    const std::size_t colon = json.find_first_not_of(kSpace, at + kKey.size());
    if (colon == std::string::npos || json[colon] != ':') continue;
    const std::size_t quote = json.find_first_not_of(kSpace, colon + 1);
    if (quote == std::string::npos || json[quote] != '"' || json.compare(quote + 1, 5, "data:") == 0)
      continue;
    const std::string uri = jsonString(json, quote + 1);
    if (uri.empty() || uri.find('\0') != std::string::npos) continue;
    uris.insert(uri);
    uris.insert(percentDecoded(uri));
  }
  return uris;
}

/// The regular file `relative` in the first of the folders that has one.
fs::path findIn(const std::vector<fs::path>& folders, const fs::path& relative) {
  std::error_code error;
  for (const fs::path& folder : folders) {
    if (fs::is_regular_file(folder / relative, error)) return folder / relative;
  }
  return {};
}

}  // namespace

std::vector<MeshReference> referencesOf(const fs::path& mesh) {
  std::vector<MeshReference> references;
  const std::string extension = extensionOf(mesh);
  const bool is_obj = extension == ".obj";
  if (!is_obj && extension != ".gltf" && extension != ".glb") return references;
  std::ifstream in(mesh, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  std::error_code error;
  const fs::path folder = fs::absolute(mesh).lexically_normal().parent_path();
  std::vector<fs::path> folders{folder};
  const fs::path target = fs::canonical(mesh, error);
  if (!error) folders.push_back(target.parent_path());
  for (const std::string& uri : is_obj ? librariesOf(text.str()) : urisOf(text.str())) {
    const fs::path relative = fs::path(uri).lexically_normal();
    if (relative.is_absolute() || relative.empty() || *relative.begin() == "..") continue;
    references.push_back({folder / relative, findIn(folders, relative), is_obj});
  }
  return references;
}

}  // namespace tenon::bake
