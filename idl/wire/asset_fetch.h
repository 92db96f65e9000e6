#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.h"
#include "idl/wire/assets.h"

namespace tenon::wire {

/// Called with the bytes that are there, of so many in all.
using FetchProgress = std::function<void(std::uint64_t bytes, std::uint64_t of)>;

/// The asset `name`: from `store`, or from the console at `url` (http://HOST[:PORT]), which serves those of
/// its machine; then it is in `store`, too. What an interrupted fetch got is kept beside it, and the next one
/// continues there. Fails with a sentence: when it is nowhere, when nothing comes for 10 s, when what came
/// has another hash than its name (then all of it is fetched again the next time), when `stop` is set.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<std::vector<std::uint8_t>> fetchAsset(const AssetStore& store, std::string_view name,
                                                           const std::string& url,
                                                           const FetchProgress& progress,
                                                           const std::atomic<bool>& stop);

}  // namespace tenon::wire
