#include "tests/bench/engine/sessions.h"

#include <memory>
#include <utility>
#include <vector>

#include "clients/station/device_station.h"

namespace tenon::bench {

Result<rehearse::RehearsalReport> rehearsePeople(const session::LoadedScene& loaded,
                                                 const rehearse::RehearsalOptions& options) {
  std::vector<std::unique_ptr<haptic::Station>> stations;
  for (const Role role : {Role::kTrainee, Role::kInstructor}) {
    if (role == Role::kInstructor && !loaded.scenario->handNamed("instructor").valid()) continue;
    auto opened = station::DeviceStation::open(station::defaultStation(role, {.seed = options.seed}));
    if (!opened) return fail(opened.error().what);
    stations.push_back(std::move(*opened));
  }
  return rehearse::runRehearsal(loaded, std::move(stations), options);
}

}  // namespace tenon::bench
