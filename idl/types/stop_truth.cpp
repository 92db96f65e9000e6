#include "idl/types/stop_truth.h"

#include <iterator>

namespace tenon {
namespace {

template <class M>
std::size_t countOf(const std::map<RaiseId, M>& kept, const std::string& client_guid) {
  std::size_t count = 0;
  for (auto at = kept.lower_bound({client_guid, 0}); at != kept.end() && at->first.client_guid == client_guid;
       ++at)
    ++count;
  return count;
}

/// What has to go for `newest`, which is in `kept`: the lowest counter of its client, or the first of all;
/// none within the bounds.
template <class M>
std::optional<RaiseId> surplus(const std::map<RaiseId, M>& kept, const RaiseId& newest) {
  const auto otherThanNewest = [&](auto at) { return at->first == newest ? std::next(at) : at; };
  if (countOf(kept, newest.client_guid) > StopTruth::kMostOfClient)
    return otherThanNewest(kept.lower_bound({newest.client_guid, 0}))->first;
  if (kept.size() > StopTruth::kMostInAll) return otherThanNewest(kept.begin())->first;
  return std::nullopt;
}

}  // namespace

StopChange StopTruth::raise(const EmergencyStop& stop) {
  const RaiseId id{stop.client_guid, stop.counter};
  if (cleared_.contains(id) || standing_.contains(id)) return {};
  ++raised_;
  StopChange change{.changed = true};
  const bool is_full =
      standing_.size() >= kMostInAll || countOf(standing_, stop.client_guid) >= kMostOfClient;
  if (is_full) {
    change.superfluous = {id.client_guid, id.counter, stop.who, "other raises stand"};
    change.forgotten = clear(*change.superfluous).forgotten;
  } else {
    standing_.emplace(id, stop);
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
