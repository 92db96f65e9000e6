#include <cstdio>
#include <string>

#include "clients/haptic/station_command_line.h"
#include "clients/trainee/trainee_station.h"
#include "devices/catalog.h"

namespace {

/// `--stubborn` is an error of one line that names the option to use instead.
void refuseFormerOption(CLI::App& app) {
  app.add_option_function<std::string>("--stubborn",
                                       [](const std::string&) {
                                         std::fputs("tenon-trainee: --stubborn is now --misplace-mount\n",
                                                    stderr);
                                         throw CLI::RuntimeError(2);
                                       })
      ->expected(0, 1)
      ->group("");
}

}  // namespace

int main(int argc, char** argv) {
  tenon::trainee::TraineeOptions trainee;
  std::string tactile = "intensity";
  const auto declare = [&](CLI::App& app) {
    app.add_option("--device", trainee.device, "a bimanual haptic device")
        ->check([](const std::string& name) {
          const auto known = tenon::devices::checkBimanualDeviceName(name);
          return known ? std::string() : known.error().what;
        })
        ->capture_default_str();
    app.add_option("--tactors", trainee.tactors, "the vibrotactile bracelet")
        ->check([](const std::string& name) {
          const auto known = tenon::devices::checkDeviceName(name);
          return known ? std::string() : known.error().what;
        })
        ->capture_default_str();
    app.add_option("--tactile", tactile, "how contacts of the forearm vibrate")
        ->check(CLI::IsMember({"intensity", "pattern"}))
        ->capture_default_str();
    app.add_flag("--swap-hands", trainee.swap_hands,
                 "the right arm moves hand `left` and the left arm hand `right`");
    app.add_option(
           "--misplace-mount", trainee.person.misplaced_mount,
           "the simulated trainee inserts the N-th mount, from 0, at a wrong pose and does not correct it; "
           "-1: none")
        ->option_text("N [-1]");
    refuseFormerOption(app);
  };
  const auto open = [&]() -> tenon::Result<std::unique_ptr<tenon::haptic::Station>> {
    trainee.tactile =
        tactile == "pattern" ? tenon::haptic::TactileMode::kPattern : tenon::haptic::TactileMode::kIntensity;
    return tenon::trainee::TraineeStation::open(trainee);
  };
  return tenon::haptic::runStationMain(
      argc, argv,
      {"tenon-trainee",
       "the trainee's station: a bimanual haptic device, a tracked forearm with a "
       "vibrotactile bracelet, a tracked head",
       "trainee", trainee.person.seed, declare, open});
}
