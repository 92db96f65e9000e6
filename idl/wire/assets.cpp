#include "idl/wire/assets.h"

#include <algorithm>
#include <fstream>
#include <random>

#include "idl/wire/identity.h"

namespace tenon::wire {

namespace fs = std::filesystem;

namespace {
constexpr std::size_t kNameLength = 30;
constexpr std::uintmax_t kMaxAssetBytes = 1024U << 20U;
}  // namespace

std::string assetName(std::span<const std::uint8_t> bytes) {
  return contentHash(bytes).substr(0, kNameLength);
}

bool isAssetName(std::string_view text) {
  return text.size() == kNameLength && std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

bool AssetStore::has(std::string_view name) const {
  std::error_code error;
  return isAssetName(name) && fs::is_regular_file(folder_ / name, error);
}

Result<std::string> AssetStore::put(std::span<const std::uint8_t> bytes) const {
  std::string name = assetName(bytes);
  if (get(name)) return name;
  std::error_code error;
  fs::create_directories(folder_, error);
  const fs::path written = folder_ / (name + "." + std::to_string(std::random_device{}()));
  {
    std::ofstream out(written, std::ios::binary);
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    out.flush();
    if (!out) return fail(written.string() + ": cannot be written");
  }
  fs::rename(written, folder_ / name, error);
  if (error) return fail(written.string() + ": cannot be renamed: " + error.message());
  return name;
}

Result<std::vector<std::uint8_t>> AssetStore::get(std::string_view name) const {
  if (!isAssetName(name))
    return fail("'" + std::string(name.substr(0, 80)) + "' is not the name of an asset");
  const fs::path file = folder_ / name;
  std::error_code error;
  const std::uintmax_t size = fs::file_size(file, error);
  if (error) return fail(file.string() + ": " + error.message());
  if (size > kMaxAssetBytes) return fail(file.string() + ": is longer than an asset may be");
  std::vector<std::uint8_t> bytes(size);
  std::ifstream in(file, std::ios::binary);
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (in.gcount() != static_cast<std::streamsize>(size) || assetName(bytes) != name)
    return fail(file.string() + ": is damaged: its content has another hash than its name");
  return bytes;
}

}  // namespace tenon::wire
