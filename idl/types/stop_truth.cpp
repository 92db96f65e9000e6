#include "idl/types/stop_truth.h"

namespace tenon {

bool StopTruth::raise(const EmergencyStop& stop) {
  const RaiseId id{stop.client_guid, stop.counter};
  if (cleared_.contains(id) || !standing_.emplace(id, stop).second) return false;
  ++raised_;
  return true;
}

bool StopTruth::clear(const EmergencyClear& cleared) {
  const RaiseId id{cleared.client_guid, cleared.counter};
  standing_.erase(id);
  return cleared_.emplace(id, cleared).second;
}

}  // namespace tenon
