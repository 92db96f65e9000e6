#include "tests/bench/engine/sessions.h"

#include <memory>
#include <utility>
#include <vector>

#include "clients/instructor/instructor_station.h"
#include "clients/trainee/trainee_station.h"

namespace tenon::bench {

Result<rehearse::RehearsalReport> rehearsePeople(const session::LoadedScene& loaded,
                                                 const rehearse::RehearsalOptions& options) {
  std::vector<std::unique_ptr<haptic::Station>> stations;
  trainee::TraineeOptions trainee;
  trainee.person.seed = options.seed;
  auto opened = trainee::TraineeStation::open(trainee);
  if (!opened) return fail(opened.error().what);
  stations.push_back(std::move(*opened));
  if (loaded.scenario->handNamed("instructor").valid()) {
    instructor::InstructorOptions instructor;
    instructor.person.seed = options.seed;
    auto opened_instructor = instructor::InstructorStation::open(instructor);
    if (!opened_instructor) return fail(opened_instructor.error().what);
    stations.push_back(std::move(*opened_instructor));
  }
  return rehearse::runRehearsal(loaded, std::move(stations), options);
}

}  // namespace tenon::bench
