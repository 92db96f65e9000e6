#include "server/bake/mesh_file_checks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>

namespace tenon::bake {

namespace {

std::string lowerExtension(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(c >= 'A' && c <= 'Z' ? c + 32 : c); });
  return extension;
}

std::string beginning(const std::filesystem::path& file, std::size_t bytes) {
  std::ifstream in(file, std::ios::binary);
  std::string text(bytes, '\0');
  in.read(text.data(), static_cast<std::streamsize>(bytes));
  text.resize(static_cast<std::size_t>(std::max<std::streamsize>(in.gcount(), 0)));
  return text;
}

std::optional<std::string> problemInAsciiStl(const std::string& text) {
  if (text.rfind("solid", 0) != 0) return {};
  for (std::size_t at = text.find("vertex"); at != std::string::npos; at = text.find("vertex", at + 6)) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string line = text.substr(at, end - at);
    // a binary STL may also begin with "solid": a line with other characters is no line of coordinates
    if (line.find_first_not_of("vertex 0123456789+-.,eE\t\r") != std::string::npos) return {};
    if (line.find(',') != std::string::npos)
      return "numbers are written with a decimal comma: '" + line + "'";
  }
  return {};
}

std::optional<std::string> problemInGltf(const std::string& json) {
  constexpr std::string_view kKey = "\"rotation\"";
  for (std::size_t at = json.find(kKey); at != std::string::npos; at = json.find(kKey, at + kKey.size())) {
    const std::size_t open = json.find_first_not_of(" \t\r\n:", at + kKey.size());
    if (open == std::string::npos || json[open] != '[') continue;
    const char* next = json.c_str() + open + 1;
    double squared = 0.0;
    int count = 0;
    for (; count < 4; ++count) {
      char* end = nullptr;
      const double value = std::strtod(next, &end);
      if (end == next) break;
      squared += value * value;
      next = end + std::strspn(end, " \t\r\n,");
    }
    if (count == 4 && !(std::abs(squared - 1.0) < 0.02)) {
      return "a node's rotation is not a unit quaternion (length " + std::to_string(std::sqrt(squared)) + ")";
    }
  }
  return {};
}

}  // namespace

std::optional<std::string> problemInMeshFile(const std::filesystem::path& file) {
  constexpr std::size_t kCheckedBytes = 16U << 20U;
  const std::string extension = lowerExtension(file);
  if (extension == ".stl") return problemInAsciiStl(beginning(file, kCheckedBytes));
  if (extension == ".gltf" || extension == ".glb") return problemInGltf(beginning(file, kCheckedBytes));
  return {};
}

}  // namespace tenon::bake
