#include <string>

#include "clients/haptic/station_words.h"
#include "clients/trainee/trainee_station.h"

int main(int argc, char** argv) {
  tenon::TraineeOptions trainee;
  std::string tactile = "intensity";
  const auto declare = [&](CLI::App& app) {
    app.add_option("--device", trainee.device, "a machine with two arms")->capture_default_str();
    app.add_option("--tactors", trainee.tactors, "the arm band")->capture_default_str();
    app.add_option("--tactile", tactile, "how contacts of the forearm vibrate")
        ->check(CLI::IsMember({"intensity", "pattern"}))
        ->capture_default_str();
    app.add_flag("--swap-hands", trainee.swap_hands,
                 "the right arm moves hand `left` and the other way round");
    app.add_option(
           "--stubborn", trainee.person.stubborn_mount,
           "the mount (0: the first) in which the simulated trainee is sure of a wrong place; -1: none")
        ->capture_default_str();
  };
  const auto open = [&]() -> tenon::Result<std::unique_ptr<tenon::Station>> {
    trainee.tactile = tactile == "pattern" ? tenon::TactileMode::kPattern : tenon::TactileMode::kIntensity;
    return tenon::TraineeStation::open(trainee);
  };
  return tenon::runStationMain(
      argc, argv,
      {"tenon-trainee", "the trainee's station: two haptic arms, a tracked forearm with an arm band, a head",
       "trainee", trainee.person.seed, declare, open});
}
