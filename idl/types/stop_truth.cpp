#include "idl/types/stop_truth.h"

#include <algorithm>
#include <iterator>

namespace tenon {
namespace {

/// What has to go for `newest`, which is in `kept`: the lowest counter of its client, or the first of all;
/// none within the bounds.
template <class M>
std::optional<RaiseId> surplus(const std::map<RaiseId, M>& kept, const RaiseId& newest) {
  const auto otherThanNewest = [&](auto at) { return at->first == newest ? std::next(at) : at; };
  const auto first = kept.lower_bound({newest.client_guid, 0});
  std::size_t of_client = 0;
  for (auto at = first; at != kept.end() && at->first.client_guid == newest.client_guid; ++at) ++of_client;
  if (of_client > StopTruth::kMostOfClient) return otherThanNewest(first)->first;
  if (kept.size() > StopTruth::kMostInAll) return otherThanNewest(kept.begin())->first;
  return std::nullopt;
}

}  // namespace

std::vector<RaiseRange> rangesOf(std::vector<RaiseId> raises) {
  std::sort(raises.begin(), raises.end());
  std::vector<RaiseRange> all;
  for (const RaiseId& raise : raises) {
    const bool continues =
        !all.empty() && all.back().client_guid == raise.client_guid && raise.counter - all.back().last <= 1;
    if (!continues && all.size() == kMostRanges) break;
    if (!continues) all.push_back({raise.client_guid, raise.counter, raise.counter});
    all.back().last = raise.counter;
  }
  return all;
}

StopChange StopTruth::raise(const EmergencyStop& stop) {
  const RaiseId id{stop.client_guid, stop.counter};
  if (cleared_.contains(id) || !standing_.emplace(id, stop).second) return {};
  ++raised_;
  StopChange change{.changed = true};
  if (const auto old = surplus(standing_, id)) {
    change.superseded = {old->client_guid, old->counter, stop.who, "a newer raise stands"};
    change.forgotten = clear(*change.superseded).forgotten;
  }
  return change;
}

StopChange StopTruth::clear(const EmergencyClear& cleared) {
  const RaiseId id{cleared.client_guid, cleared.counter};
  standing_.erase(id);
  if (!cleared_.emplace(id, cleared).second) return {};
  StopChange change{.changed = true};
  change.forgotten = surplus(cleared_, id);
  if (change.forgotten) cleared_.erase(*change.forgotten);
  return change;
}

}  // namespace tenon
