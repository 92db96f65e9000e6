#include "clients/haptic/station_words.h"
#include "clients/instructor/instructor_station.h"

int main(int argc, char** argv) {
  tenon::InstructorOptions instructor;
  const auto declare = [&](CLI::App& app) {
    app.add_option("--device", instructor.device, "sigma7-sim, omega3-sim or falcon-sim")
        ->capture_default_str();
  };
  const auto open = [&]() -> tenon::Result<std::unique_ptr<tenon::Station>> {
    return tenon::InstructorStation::open(instructor);
  };
  return tenon::runStationMain(
      argc, argv,
      {"tenon-instructor", "the instructor's station: a desk device that moves the teaching assistant",
       "instructor", instructor.person.seed, declare, open});
}
