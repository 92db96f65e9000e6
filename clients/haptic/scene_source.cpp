#include "clients/haptic/scene_source.h"

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "idl/record/compression.h"
#include "idl/wire/asset_fetch.h"
#include "server/simulation/compiled_scene.h"

namespace tenon::haptic {

namespace {
constexpr std::string_view kKey = R"("compiled":")";
constexpr std::size_t kNameLength = 30;
constexpr std::size_t kMostBytes = std::size_t{4} << 30U;  // of a scene
constexpr std::chrono::seconds kReportEvery{2};

/// A line on what is fetched, every two seconds.
wire::FetchProgress reporting(const std::function<void(const std::string&)>& print) {
  if (!print) return {};
  const auto began = std::chrono::steady_clock::now();
  return [&print, last = began](std::uint64_t bytes, std::uint64_t of) mutable {
    const auto now = std::chrono::steady_clock::now();
    if (now - last < kReportEvery) return;
    last = now;
    char line[96];
    std::snprintf(line, sizeof line, "fetching the compiled scene: %.1f of %.1f MB",
                  1e-6 * static_cast<double>(bytes), 1e-6 * static_cast<double>(of));
    print(line);
  };
}
}  // namespace

Result<std::shared_ptr<const simulation::Scene>> openScene(
    const SceneSource& source, std::string_view scene_hash,
    const std::function<void(const std::string&)>& print, const std::atomic<bool>& stop) {
  if (source.cache.empty()) return fail("this station has no folder for a compiled scene");
  if (!wire::isAssetName(scene_hash)) return fail("the server announces no compiled scene");
  const wire::AssetStore store(source.cache / "assets");
  const auto list = wire::fetchAsset(store, scene_hash, source.url, {}, stop);
  if (!list && source.url.empty())
    return fail(
        "this machine's cache has no copy of the scene: fetch it from a console at the server by "
        "--assets http://SERVER:8080");
  if (!list) return fail(list.error().what);
  const std::string_view text(reinterpret_cast<const char*>(list->data()), list->size());
  const std::size_t at = text.find(kKey);
  const std::string_view name =
      at == std::string_view::npos ? std::string_view() : text.substr(at + kKey.size(), kNameLength);
  if (!wire::isAssetName(name)) return fail("the server has no compiled scene");
  const auto packed = wire::fetchAsset(store, name, source.url, reporting(print), stop);
  if (!packed) return fail(packed.error().what);
  const auto bytes = record::decompress(*packed, kMostBytes);
  if (!bytes) return fail("the compiled scene " + std::string(name) + " " + bytes.error().what);
  return simulation::readScene(*bytes);
}

}  // namespace tenon::haptic
