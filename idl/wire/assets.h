#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.h"

namespace tenon::wire {

/// The name of an asset: 30 hexadecimal digits, the first 120 bits of the BLAKE2b hash of its bytes.
[[nodiscard]] std::string assetName(std::span<const std::uint8_t> bytes);
/// Whether `text` has the form of an asset's name; nothing else ever becomes part of a path.
[[nodiscard]] bool isAssetName(std::string_view text);

/// Immutable blobs, named by their content: display models of parts, the compiled scene, and the list of
/// those of a scene. What has the right name has the right content, wherever it came from.
///
/// Threads: any; several processes may use one folder, since files are renamed into place. Real-time: no.
class AssetStore {
 public:
  explicit AssetStore(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// Keeps `bytes` unless they are there, and returns their name. Fails when the folder cannot be written.
  [[nodiscard]] Result<std::string> put(std::span<const std::uint8_t> bytes) const;
  /// Fails when `name` is no asset's name, when the asset is not there, is longer than 1 GB or is damaged.
  [[nodiscard]] Result<std::vector<std::uint8_t>> get(std::string_view name) const;
  [[nodiscard]] bool has(std::string_view name) const;
  /// Where the asset is, if it is there. Precondition: isAssetName(name).
  [[nodiscard]] std::filesystem::path fileOf(std::string_view name) const { return folder_ / name; }

 private:
  std::filesystem::path folder_;
};

}  // namespace tenon::wire
