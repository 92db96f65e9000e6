#include "clients/recorder/model_fetch.h"

#include <chrono>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "clients/foxglove/displayed_scene.h"
#include "idl/wire/asset_fetch.h"

namespace tenon::recorder {

namespace {
constexpr std::chrono::seconds kSayEvery{2};
}  // namespace

ModelFetch::ModelFetch(wire::AssetStore store, std::string scene_hash, std::string url)
    : store_(std::move(store)), scene_hash_(std::move(scene_hash)), url_(std::move(url)) {
  thread_ = std::thread([this] {
    if (const auto done = fetch(); !done && !stop_)
      say("display models are not fetched, objects without them are boxes: " + done.error().what);
  });
}

ModelFetch::~ModelFetch() {
  stop_ = true;
  thread_.join();
}

Result<void> ModelFetch::fetch() {
  if (scene_hash_.empty()) return fail("the server announces none");
  const auto list = wire::fetchAsset(store_, scene_hash_, url_, {}, stop_);
  if (!list) return fail(list.error().what);
  has_arrivals_ = true;
  std::set<std::string> models;
  for (std::string& model : foxglove::firstLevels(*list))
    if (!model.empty() && !store_.has(model)) models.insert(std::move(model));
  std::size_t fetched = 0;
  std::uint64_t bytes = 0;
  auto said = std::chrono::steady_clock::now();
  const auto progress = [&](std::uint64_t part, std::uint64_t /*of*/) {
    const auto now = std::chrono::steady_clock::now();
    if (now - said < kSayEvery) return;
    said = now;
    say(fmt::format("fetching display models: {} of {}, {:.1f} MB so far", fetched, models.size(),
                    1e-6 * static_cast<double>(bytes + part)));
  };
  for (const std::string& name : models) {
    const auto model = wire::fetchAsset(store_, name, url_, progress, stop_);
    if (!model) return fail(model.error().what);
    has_arrivals_ = true;
    ++fetched;
    bytes += model->size();
    if (bytes > kMostBytes && fetched < models.size())
      return fail(fmt::format("those of this scene are larger than {} MB", kMostBytes >> 20U));
  }
  if (fetched > 0)
    say(fmt::format("fetched display models: {}, {:.1f} MB", fetched, 1e-6 * static_cast<double>(bytes)));
  return {};
}

void ModelFetch::say(std::string line) {
  const std::scoped_lock lock(mutex_);
  lines_.push_back(std::move(line));
}

std::vector<std::string> ModelFetch::takeLines() {
  const std::scoped_lock lock(mutex_);
  return std::exchange(lines_, {});
}

}  // namespace tenon::recorder
