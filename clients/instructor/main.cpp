#include "clients/haptic/station_command_line.h"
#include "clients/instructor/instructor_station.h"
#include "devices/catalog.h"

int main(int argc, char** argv) {
  tenon::instructor::InstructorOptions instructor;
  const auto declare = [&](CLI::App& app) {
    app.add_option("--device", instructor.device, "sigma7-sim, omega3-sim or falcon-sim")
        ->check([](const std::string& name) {
          const auto known = tenon::devices::checkDeviceName(name);
          return known ? std::string() : known.error().what;
        })
        ->capture_default_str();
  };
  const auto open = [&]() -> tenon::Result<std::unique_ptr<tenon::haptic::Station>> {
    return tenon::instructor::InstructorStation::open(instructor);
  };
  return tenon::haptic::runStationMain(
      argc, argv,
      {"tenon-instructor", "the instructor's station: a desktop haptic device that moves the pointer",
       "instructor", instructor.person.seed, declare, open});
}
