#include "clients/station/command_line.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <istream>
#include <map>
#include <memory>
#include <set>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "clients/haptic/seat_file.h"
#include "idl/types/cache_folder.h"
#include "idl/types/number_range.h"
#include "idl/types/printable_text.h"
#include "idl/wire/identity.h"
#include "idl/wire/joining_names.h"
#include "idl/wire/key_option.h"
#include "idl/wire/network.h"
#include "idl/wire/session_name.h"

namespace tenon::station {

namespace {
constexpr int kCouldNot = 1;
constexpr int kWrongUsage = 2;

/// As typed.
struct Typed {
  std::string role;
  std::vector<std::string> devices;
  std::vector<std::string> addresses;
  std::vector<std::string> serials;
  std::vector<std::string> mountings;
  std::vector<std::string> hands;
  std::optional<std::string> tracker;
  std::optional<std::string> tactors;
  std::string tactile = "intensity";
  std::optional<std::string> person;
  simulated_person::PersonOptions simulated;
  bool dead_man = false;
  bool self_paced = false;
  std::optional<std::string> name;
  haptic::StationProgramOptions program;
};

/// A former option is an error of one line that names what to use instead.
void refuseFormerOptions(CLI::App& app) {
  const auto refuse = [&app](const char* former, const char* now) {
    app.add_option_function<std::string>(former,
                                         [former, now](const std::string&) {
                                           std::fprintf(stderr, "tenon-join: %s is now %s\n", former, now);
                                           throw CLI::RuntimeError(kWrongUsage);
                                         })
        ->expected(0, 1)
        ->group("");
  };
  refuse("--stubborn", "--misplace-mount");
  refuse("--swap-hands", "--hands left,right");
}

/// Reads `--station`: a line that is no option is an error, where CLI11 does without it.
class StationFile : public CLI::ConfigTOML {
 public:
  explicit StationFile(const CLI::App& app) : app_(app) {}

  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override {
    auto read = CLI::ConfigTOML::from_config(input);
    for (const CLI::ConfigItem& item : read) {
      const bool is_known = item.parents.empty() && (app_.get_option_no_throw("--" + item.name) != nullptr ||
                                                     app_.get_option_no_throw(item.name) != nullptr);
      if (!is_known)
        throw CLI::ConfigError("'" + shortened(printable(item.fullname()), 60) +
                               "' is no option; expected a line `option = value` each, as in: device = "
                               "falcon-sim");
    }
    return read;
  }

 private:
  const CLI::App& app_;
};

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == separator) {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

/// Of lists with commas in them, the names: also an empty one, which CLI11 would leave out at the end.
std::vector<std::string> namesOf(const std::vector<std::string>& lists) {
  std::vector<std::string> names;
  for (const std::string& list : lists)
    for (std::string& name : split(list, ',')) names.push_back(std::move(name));
  return names;
}

/// A check of each name of a list.
template <class Check>
auto each(Check check) {
  return [check](const std::string& list) {
    for (const std::string& name : split(list, ',')) {
      if (name.empty()) return "a name of '" + shortened(printable(list), 60) + "' is empty";
      if (const std::string wrong = check(name); !wrong.empty()) return wrong;
    }
    return std::string();
  };
}

/// A check of a name: what is wrong with it, or nothing.
template <class Check>
auto named(Check check) {
  return [check](const std::string& name) {
    if (name == "none") return std::string();
    const auto known = check(name);
    return known ? std::string() : known.error().what;
  };
}

void declareStation(CLI::App& app, Typed& typed) {
  app.set_help_flag("-h,--help", "print this help");
  app.set_config("--station", "",
                 "file with these options, a line `option = value` each; options typed as well win");
  app.config_formatter(std::make_shared<StationFile>(app));
  app.add_option("--role", typed.role, "what the person is")
      ->required()
      ->check(CLI::IsMember({"trainee", "instructor"}));
  app.add_option(
         "--device", typed.devices,
         "devices of the catalog, in the order of their hands (trainee: hug-sim, instructor: sigma7-sim)")
      ->option_text("NAME[,NAME]")
      ->check(each(named(devices::findDevice)));
  app.add_option(
         "--hands", typed.hands,
         "the scenario's hands that the devices' arms move, of two arms the right one first (trainee: "
         "right,left, instructor: instructor)")
      ->option_text("NAME[,NAME]")
      ->check(each([](const std::string& name) {
        const auto permitted = wire::checkHandName(name);
        return permitted ? std::string() : permitted.error().what;
      }));
  app.add_option("--address", typed.addresses, "where each device is: a port, host or socket")
      ->option_text("ADDRESS[,ADDRESS]")
      ->delimiter(',');
  app.add_option("--serial", typed.serials,
                 "serial number of each device, where there are several of a kind (default: the first ones "
                 "found)")
      ->option_text("NUMBER[,NUMBER]")
      ->delimiter(',');
  app.add_option(
         "--mounting", typed.mountings,
         "how a device is turned: w:x:y:z, the quaternion from its own frame to x right, y away, z up")
      ->option_text("W:X:Y:Z[,...]")
      ->delimiter(',');
  app.add_option("--tracker", typed.tracker,
                 "of the person's forearm and head (a trainee with simulated devices: body-sim), or none")
      ->option_text("NAME|none")
      ->check(named(devices::checkTrackerName));
  app.add_option("--tactors", typed.tactors,
                 "bracelet on the tracked forearm (with a tracker: vibrotac-sim), or none")
      ->option_text("NAME|none")
      ->check(named(devices::findDevice));
  app.add_option("--tactile", typed.tactile, "how contacts of the forearm vibrate")
      ->check(CLI::IsMember({"intensity", "pattern"}))
      ->capture_default_str();
}

void declarePerson(CLI::App& app, Typed& typed) {
  app.add_option(
         "--person", typed.person,
         "who moves the devices: simulated (the default of simulated devices), none: who holds them (of "
         "all others), or files that simulated arms follow, CSV as for `tenon rehearse --input`")
      ->option_text("simulated|none|[HAND=]FILE.csv[,HAND=FILE.csv]");
  app.add_option("--seed", typed.simulated.seed, "seed of the simulated person and devices")
      ->capture_default_str()
      ->check(tenon::numberFrom(0.0, 1e18));
  app.add_option(
         "--misplace-mount", typed.simulated.misplaced_mount,
         "the simulated trainee inserts the N-th mount, from 0, at a wrong pose and does not correct it; "
         "-1: none")
      ->option_text("N [-1]");
  app.add_flag("--dead-man", typed.dead_man,
               "simulated devices have a dead man's switch, which their simulated person presses");
  app.add_flag("--self-paced", typed.self_paced,
               "simulated devices have clocks of their own: the first one paces the loop");
  app.add_flag("--arm", typed.program.armed,
               "the devices may display forces at once: the person is at the station");
}

void declareProgram(CLI::App& app, Typed& typed) {
  haptic::StationProgramOptions& program = typed.program;
  wire::MembershipOptions& membership = program.membership;
  wire::addSessionOption(app, membership.session, wire::kJoinedSessionHelp);
  app.add_option("--domain", membership.domain, "DDS domain, 0 to 230")
      ->check(CLI::Range(0, 230))
      ->capture_default_str();
  wire::addNetworkOption(app);
  app.add_flag("--lockstep", membership.lockstep,
               "require a lockstep session: one step for each received tick");
  wire::addNameOption(app, "--name", typed.name, "name shown to the other participants (default: the role)");
  app.add_option("--language", program.language, "language of the printed instructions")
      ->capture_default_str();
  app.add_option_function<unsigned>(
         "--wait", [&membership](unsigned seconds) { membership.timeout = std::chrono::seconds(seconds); },
         "seconds to search for a server, at start and after a loss of the connection")
      ->default_str("10");
  static const std::map<std::string, haptic::ForceModelWish> kWishes{
      {"auto", haptic::ForceModelWish::kAuto},
      {"manifold", haptic::ForceModelWish::kManifold},
      {"scene-copy", haptic::ForceModelWish::kSceneCopy}};
  app.add_option_function<std::string>(
         "--force-model", [&program](const std::string& word) { program.force_model = kWishes.at(word); },
         "contacts that hands render: the server's (manifold), or those of this station's own copy of "
         "the scene (scene-copy); auto: the copy if it is there and the round trip is above 4 ms")
      ->check(CLI::IsMember(kWishes))
      ->option_text("auto|manifold|scene-copy");
  app.add_option("--assets", program.scene.url,
                 "where the compiled scene is fetched that the cache does not have: a console at the server")
      ->option_text("http://HOST:PORT");
  program.scene.cache = defaultCache();
  app.add_option("--cache", program.scene.cache, "folder that keeps the compiled scene")
      ->capture_default_str();
  app.add_option(
      "--seat", program.seat_file,
      "file that keeps the secret key of the seat, so that a restarted station gets its hands back");
  wire::addKeyOption(
      app, membership.key_file,
      "file of the session's key, which instructors and admins need (default: the one of your own "
      "servers)");
}

Result<Quaternion> parseMounting(const std::string& text) {
  double w = 0.0, x = 0.0, y = 0.0, z = 0.0;
  char more = 0;
  const bool read = std::sscanf(text.c_str(), "%lf:%lf:%lf:%lf%c", &w, &x, &y, &z, &more) == 4;
  const Quaternion q_DM(w, x, y, z);
  if (!read || !(std::abs(q_DM.norm() - 1.0) <= 0.01))
    return fail("--mounting " + text + ": expected a unit quaternion, as in 0.7071:0:0:0.7071");
  return q_DM.normalized();
}

/// A remote hand without an address waits in the user's runtime folder, at a socket of its hand's name.
Result<void> setRemoteAddresses(StationOptions& station) {
  std::size_t arm = 0;
  for (StationDevice& device : station.devices) {
    const std::vector<std::string> hands =
        station.hands.empty() ? defaultHands(station.role, arm + 1) : station.hands;
    const bool named = device.name != devices::kRemoteHand || !device.configuration.address.empty();
    if (!named && arm < hands.size()) {
      const auto folder = wire::runtimeFolder();
      if (!folder) return fail(folder.error().what);
      device.configuration.address = *folder / ("remote-" + hands[arm] + ".sock");
    }
    const auto facts = devices::findDevice(device.name);
    arm += facts ? facts->arms : 1;
  }
  return {};
}

/// The devices with what each is opened with.
Result<void> setDevices(const Typed& typed, StationOptions& station) {
  const auto tooMany = [&](const auto& list) { return list.size() > typed.devices.size(); };
  if (tooMany(typed.addresses) || tooMany(typed.serials) || tooMany(typed.mountings))
    return fail("--address, --serial, --mounting: expected one for each --device at most");
  if (!typed.devices.empty()) station.devices.clear();
  for (std::size_t i = 0; i < typed.devices.size(); ++i) {
    StationDevice device{typed.devices[i], {}};
    device.configuration.seed = typed.simulated.seed + i;
    if (i < typed.addresses.size()) device.configuration.address = typed.addresses[i];
    if (i < typed.serials.size()) device.configuration.serial = typed.serials[i];
    if (const auto facts = devices::findDevice(device.name);
        facts && facts->serials == nullptr && !device.configuration.serial.empty())
      return fail("--serial " + device.configuration.serial + ": device '" + device.name +
                  "' has no serial number");
    if (i < typed.mountings.size()) {
      if (device.name == devices::kRemoteHand)
        return fail("--mounting: a remote hand's program turns its poses itself");
      const auto q_DM = parseMounting(typed.mountings[i]);
      if (!q_DM) return fail(q_DM.error().what);
      device.configuration.q_DM = *q_DM;
    }
    station.devices.push_back(std::move(device));
  }
  for (StationDevice& device : station.devices) {
    device.configuration.dead_man = typed.dead_man;
    device.configuration.paces = typed.self_paced;
  }
  station.hands = typed.hands;
  return setRemoteAddresses(station);
}

/// What is not of the catalog is not counted.
std::size_t armsOf(const StationOptions& station) {
  std::size_t arms = 0;
  for (const StationDevice& device : station.devices)
    if (const auto facts = devices::findDevice(device.name)) arms += facts->arms;
  return arms;
}

/// Whether hands fit the arms of the devices.
Result<void> checkHands(const StationOptions& station) {
  for (const StationDevice& device : station.devices) {
    const auto facts = devices::findDevice(device.name);
    if (!facts) return fail("--device: " + facts.error().what);
    if (facts->arms == 0)
      return fail("--device " + device.name + ": moves no hand; expected a device with an arm");
  }
  const std::size_t arms = armsOf(station);
  const std::set<std::string> names(station.hands.begin(), station.hands.end());
  if (names.size() != station.hands.size()) return fail("--hands: a name is given twice");
  if (names.contains("")) return fail("--hands: a name is empty");
  if (!station.hands.empty() && station.hands.size() != arms)
    return fail(fmt::format("--hands: the devices have {} arms for {} hands; expected one for each", arms,
                            station.hands.size()));
  if (arms > defaultHands(station.role, arms).size() && station.hands.empty())
    return fail(fmt::format("--device: {} arms; name their hands with --hands", arms));
  return {};
}

bool allSimulated(const StationOptions& station) {
  for (const StationDevice& device : station.devices) {
    if (const auto facts = devices::findDevice(device.name); !facts || !facts->simulated) return false;
  }
  return true;
}

/// "FILE" or "HAND=FILE", of a station with these hands; `moved`: those that have a file already.
Result<HandScript> scriptOf(const std::string& text, const std::vector<std::string>& hands,
                            std::set<std::string>& moved) {
  const std::size_t equals = text.find('=');
  HandScript script;
  if (equals != std::string::npos) script.hand = text.substr(0, equals);
  const bool is_known =
      script.hand.empty() || std::find(hands.begin(), hands.end(), script.hand) != hands.end();
  if (!is_known)
    return fail(fmt::format("--person {}: this station has no hand '{}'; it has: {}", text, script.hand,
                            fmt::join(hands, ", ")));
  if (equals == 0 || text.empty())
    return fail(fmt::format("--person '{}': expected [HAND=]FILE.csv; this station has the hands: {}", text,
                            fmt::join(hands, ", ")));
  // a file without a hand moves the first one
  const std::string& hand = script.hand.empty() ? hands.front() : script.hand;
  if (!moved.insert(hand).second)
    return fail(fmt::format("--person {}: another file moves hand '{}' already", text, hand));
  return script;
}

/// Reads the files of `--person`, when all of it is understood.
Result<void> setPerson(const Typed& typed, StationOptions& station) {
  const std::string person = typed.person.value_or(allSimulated(station) ? "simulated" : "none");
  station.kind = person == "none" ? PersonKind::kNone : PersonKind::kSimulated;
  if (person == "none" || person == "simulated") return {};
  station.kind = PersonKind::kScript;
  const std::vector<std::string> hands =
      station.hands.empty() ? defaultHands(station.role, armsOf(station)) : station.hands;
  std::set<std::string> moved;
  const std::vector<std::string> texts = split(person, ',');
  for (const std::string& text : texts) {
    auto script = scriptOf(text, hands, moved);
    if (!script) return fail(script.error().what);
    station.scripts.push_back(std::move(*script));
  }
  for (std::size_t i = 0; i < texts.size(); ++i) {
    const std::size_t equals = texts[i].find('=');
    auto trajectory =
        HandTrajectory::read(equals == std::string::npos ? texts[i] : texts[i].substr(equals + 1));
    if (!trajectory) return fail("--person: " + trajectory.error().what);
    station.scripts[i].trajectory = std::move(*trajectory);
  }
  return {};
}

Result<void> setTracking(const Typed& typed, StationOptions& station) {
  const bool wanted = station.role == Role::kTrainee && allSimulated(station);
  station.tracker = typed.tracker.value_or(wanted ? std::string(devices::kBodyTracker) : "none");
  if (station.tracker == "none") station.tracker.clear();
  station.tactors =
      typed.tactors.value_or(station.tracker.empty() ? "none" : std::string(devices::kBracelet));
  if (station.tactors == "none") station.tactors.clear();
  station.tactile =
      typed.tactile == "pattern" ? haptic::TactileMode::kPattern : haptic::TactileMode::kIntensity;
  if (station.tactors.empty()) return {};
  const auto facts = devices::findDevice(station.tactors);
  if (!facts || facts->arms > 0)
    return fail(
        fmt::format("--tactors {}: is no bracelet; expected {}", station.tactors, devices::kBracelet));
  if (station.tracker.empty()) return fail("--tactors: a bracelet is on the forearm that --tracker follows");
  return {};
}

Result<JoinArguments> join(Typed& typed) {
  typed.devices = namesOf(typed.devices);
  typed.hands = namesOf(typed.hands);
  const Role role = typed.role == "instructor" ? Role::kInstructor : Role::kTrainee;
  JoinArguments arguments{defaultStation(role, typed.simulated), typed.program};
  if (auto set = setDevices(typed, arguments.station); !set) return fail(set.error().what);
  if (auto fits = checkHands(arguments.station); !fits) return fail(fits.error().what);
  if (auto set = setPerson(typed, arguments.station); !set) return fail(set.error().what);
  if (auto set = setTracking(typed, arguments.station); !set) return fail(set.error().what);
  if (!allSimulated(arguments.station) && arguments.station.kind != PersonKind::kNone)
    return fail("--person: only simulated devices can be moved by a simulated person or a file");
  arguments.program.membership.person = typed.name.value_or(typed.role);
  return arguments;
}

int printError(const std::string& what, int exit_code) {
  std::fprintf(stderr, "tenon-join: %s\n", what.c_str());
  return exit_code;
}
}  // namespace

CommandLine readCommandLine(int argc, char** argv) {
  CLI::App app(
      "A station: a person's devices, each arm of which moves a hand of the scenario, and trackers of "
      "forearm "
      "and head.",
      "tenon join");
  Typed typed;
  declareStation(app, typed);
  declarePerson(app, typed);
  declareProgram(app, typed);
  refuseFormerOptions(app);
  app.footer(
      "A simulated person arms its devices by itself. Else a station starts without force until its person\n"
      "presses the return key, or with --arm. Exit code: 0 the session is over, 1 it could not be done,\n"
      "2 wrong usage.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ConfigError& error) {
    return {std::nullopt,
            printError("--station " + app.get_config_ptr()->as<std::string>() + ": " + error.what(),
                       kWrongUsage)};
  } catch (const CLI::ParseError& error) {
    return {std::nullopt, app.exit(error) == 0 ? 0 : kWrongUsage};
  }
  auto arguments = join(typed);
  if (!arguments) return {std::nullopt, printError(arguments.error().what, kWrongUsage)};
  const std::filesystem::path& seat = arguments->program.seat_file;
  if (!haptic::mayBeSeatFile(seat))
    return {
        std::nullopt,
        printError(seat.string() + ": is not the file of a seat; name another one with --seat", kCouldNot)};
  if (const auto key = wire::checkKeyOption(arguments->program.membership.key_file); !key)
    return {std::nullopt, printError(key.error().what, kCouldNot)};
  return {std::move(*arguments), 0};
}

}  // namespace tenon::station
