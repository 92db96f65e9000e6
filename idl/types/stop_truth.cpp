#include "idl/types/stop_truth.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace tenon {
namespace {

/// Whether `kept` has this raise, or a later one of its client.
template <class M>
bool reaches(const std::map<std::string, M>& kept, const EmergencyStop& raise) {
  const auto found = kept.find(raise.client_guid);
  return found != kept.end() && found->second.counter >= raise.counter;
}

}  // namespace

bool StopTruth::stands(const EmergencyStop& stop) const { return reaches(standing_, stop); }

bool StopTruth::wasCleared(const EmergencyStop& stop) const { return reaches(cleared_, stop); }

std::uint32_t StopTruth::newestOf(const std::string& client_guid) const {
  const auto raise = standing_.find(client_guid);
  const auto clear = cleared_.find(client_guid);
  return std::max(raise == standing_.end() ? 0 : raise->second.counter,
                  clear == cleared_.end() ? 0 : clear->second.counter);
}

StopChange StopTruth::raise(const EmergencyStop& stop) {
  if (wasCleared(stop) || stands(stop)) return {};
  ++raised_;
  StopChange change{.changed = true};
  if (const auto former = standing_.find(stop.client_guid); former != standing_.end()) {
    change.ended = std::exchange(former->second, stop);
  } else if (standing_.size() < kMostClients) {
    standing_.emplace(stop.client_guid, stop);
  } else {
    change.superfluous = {stop.client_guid, stop.counter, stop.who, "other raises stand"};
    change.forgotten = clear(*change.superfluous).forgotten;
  }
  return change;
}

StopChange StopTruth::clear(const EmergencyClear& cleared) {
  const auto known = cleared_.find(cleared.client_guid);
  if (known != cleared_.end() && known->second.counter >= cleared.counter) return {};
  StopChange change{.changed = true};
  if (const auto raise = standing_.find(cleared.client_guid);
      raise != standing_.end() && raise->second.counter <= cleared.counter)
    change.ended = std::move(standing_.extract(raise).mapped());
  if (known != cleared_.end()) {
    change.forgotten = std::exchange(known->second, cleared);
  } else {
    const auto newest = cleared_.emplace(cleared.client_guid, cleared).first;
    if (cleared_.size() > kMostClients) {
      const auto surplus = newest == cleared_.begin() ? std::next(newest) : cleared_.begin();
      change.forgotten = std::move(cleared_.extract(surplus).mapped());
    }
  }
  return change;
}

}  // namespace tenon
