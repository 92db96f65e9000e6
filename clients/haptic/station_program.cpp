#include "clients/haptic/station_program.h"

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "clients/haptic/answer_readers.h"
#include "clients/haptic/arming_thread.h"
#include "clients/haptic/copy_loader.h"
#include "clients/haptic/link_adaptation.h"
#include "clients/haptic/lockstep_answers.h"
#include "clients/haptic/return_key.h"
#include "clients/haptic/seat_file.h"
#include "clients/haptic/servo_thread.h"
#include "clients/haptic/station_events.h"
#include "clients/haptic/station_link.h"
#include "clients/haptic/station_stops.h"
#include "idl/threads/cyclic_thread.h"

namespace tenon::haptic {

namespace {
using std::chrono::milliseconds;
constexpr milliseconds kRepeatAfter{500};
// After kMaxRejoins rejoins with less than kMinSeatTime between a rejoin and the next loss, wait that long
// before another one: two programs that take each other's seat are not to do so many times a second.
constexpr std::chrono::seconds kMinSeatTime{10};
constexpr int kMaxRejoins = 3;
constexpr int kFinishSteps = 200;  // in lockstep, to take the forces away, at most

std::atomic<bool>& stopFlag() {
  static std::atomic<bool> flag{false};
  return flag;
}

/// A step without its texts, so that copying it does not allocate.
StepState withoutTexts(StepState step) {
  step.name = {};
  step.part = {};
  step.title = {};
  step.instruction = {};
  return step;
}

const char* wayToArm(bool by_key, bool by_button) {
  if (by_key) return by_button ? "press return, or the device's arming button," : "press return";
  return by_button ? "press the device's arming button" : "start it with --arm";
}

/// After a stop. A station that nobody can press at stays without forces.
std::string wayToContinue(const Station& station, bool by_key) {
  const bool by_button = station.hasArmingButton();
  if (by_key || by_button) return wayToArm(by_key, by_button) + std::string(" to continue at this station");
  return station.pressesItself() ? ""
                                 : "nobody can press at this station: start it anew with --arm to continue";
}

class StationRunner {
 public:
  StationRunner(Station& station, StationLink& link, const StationProgramOptions& options)
      : station_(station),
        link_(link),
        options_(options),
        servo_thread_(
            station, [&link] { link.inbox().wake(); }, options.real_time),
        servo_(servo_thread_.loop()),
        readers_(link, {[this](const WorldFrame& frame) { passAnswer(frame); },
                        [this](const HandManifold& manifold) { passAnswer(manifold); }}),
        stops_(link,
               {[this](const StopSignal& stop) { pass(stop); },
                [this](const std::string& text) { print(text); }},
               wayToContinue(station, options.read_keys)),
        arming_(station, [this](const std::string& text) { print(text); }),
        events_(
            station, link, [this](const std::string& text) { print(text); }, options.read_keys),
        copy_(station, options.scene, options.force_model),
        adaptation_(link, options.force_model) {}

  Result<RunState> run(const std::atomic<bool>& stop) {
    if (auto subscribed = subscribe(); !subscribed) return fail(subscribed.error().what);
    if (auto matched = link_.awaitMatch(stop); !matched) return fail(matched.error().what);
    if (auto loaded = copy_.loadIfAsked(sceneHash(), options_.print, stop); !loaded)
      return fail(loaded.error().what);
    if (copy_.loaded()) use(adaptation_.chooseFirstModel(true));
    station_.welcome(link_.welcome(), link_.objects());
    events_.sendDevices();
    auto run = lockstep_ ? runLockstep(stop) : runRealTime(stop);
    events_.sendWaiting();
    return run;
  }

 private:
  Result<void> subscribe();
  Result<RunState> runLockstep(const std::atomic<bool>& stop);
  Result<RunState> runRealTime(const std::atomic<bool>& stop);
  void send(const StationOutput& output);
  /// Of the station's steps up to `seq`.
  void sendEvents(std::uint32_t seq);
  void printStep(const StepState& step);
  void takeLoadedScene();
  void use(ForceModelKind kind);
  std::uint32_t sendInputs(const StationOutput& output);
  void sendTelemetry(Telemetry telemetry);
  void readKeys();
  /// In lockstep between two steps, unless `stop` comes or the run is over before the device answers.
  void armDevices(const std::atomic<bool>& stop);
  void awaitArming(const std::atomic<bool>& stop);
  /// The emergency stop, and who sits at the station.
  void hear() {
    link_.inbox().dispatch(milliseconds(20));
    readKeys();
  }
  [[nodiscard]] bool seated() const { return !link_.member().lost(); }
  /// Rejoins. `new_seat`: client, hands or server epoch differ from before, so the station has to restart.
  [[nodiscard]] Result<void> rejoin(const std::atomic<bool>& stop, bool& new_seat);
  void restartStation();
  [[nodiscard]] Result<RunState> takePart(const std::atomic<bool>& stop);
  /// To the loop, or in lockstep to the station itself.
  template <class Message>
  void pass(const Message& message) {
    lockstep_ ? static_cast<void>(station_.receive(message)) : servo_.receive(message);
  }
  template <class Answer>
  void passAnswer(const Answer& answer) {
    if (lockstep_) answers_.received(answer);
    pass(answer);
  }
  [[nodiscard]] const std::string& sceneHash() const { return link_.member().announce().scene_hash; }
  [[nodiscard]] Result<RunState> takePartInLockstep(const std::atomic<bool>& stop, std::uint32_t& seq);
  void print(const std::string& text) const {
    if (options_.print && !text.empty()) options_.print(text);
  }
  [[nodiscard]] bool over() const { return isOver(run_.phase); }

  Station& station_;
  StationLink& link_;
  const StationProgramOptions& options_;
  ServoThread servo_thread_;  // in real time
  ServoLoop& servo_;
  AnswerReaders readers_;
  StationStops stops_;
  bool lockstep_ = false;  // no loop: the wire thread steps the station
  LockstepAnswers answers_;
  PeakForces peaks_;  // in lockstep
  RunState run_;
  std::uint32_t stated_seq_ = 0;  // of the last HandState
  ArmingThread arming_;
  int rejoins_ = 0;
  std::chrono::steady_clock::time_point rejoined_at_{};
  std::optional<StepState> step_;
  std::map<std::uint32_t, CollisionMatrix> matrix_;  // by part
  StationEvents events_;
  CopyLoader copy_;
  LinkAdaptation adaptation_;
  ForceModelKind force_model_ = ForceModelKind::kManifold;
  double answers_lost_ = 0.0;     // [-] as it was known last
  std::uint32_t output_seq_ = 0;  // of the loop's last output
  std::string printed_step_;
};

Result<void> StationRunner::subscribe() {
  lockstep_ = link_.welcome().lockstep;
  wire::Partition& session = link_.member().session();
  wire::Inbox& inbox = link_.inbox();
  Result<void> all = readers_.open();
  if (all) {
    all = inbox.on<Guidance>(session, wire::kGuidance, [this](const Guidance& guidance) { pass(guidance); });
  }
  if (all) {
    all = inbox.on<StepState>(session, wire::kStepState, [this](const StepState& step) {
      answers_.received(step);
      printStep(step);
      step_ = withoutTexts(step);
      lockstep_ ? station_.receive(step) : servo_.receive(*step_);
    });
  }
  if (all) {
    all = inbox.on<CollisionMatrix>(session, wire::kCollisionMatrix, [this](const CollisionMatrix& matrix) {
      matrix_[matrix.part] = matrix;
      pass(matrix);
    });
  }
  if (all) all = stops_.subscribe();
  if (all && !lockstep_) all = adaptation_.subscribe();
  if (all) all = inbox.on<RunState>(session, wire::kRunState, [this](const RunState& run) { run_ = run; });
  return all;
}

void StationRunner::sendTelemetry(Telemetry telemetry) {
  telemetry.client = link_.welcome().client;
  const std::optional<double> lost = readers_.takeLoss();
  telemetry.answers_lost = answers_lost_ = lost.value_or(answers_lost_);
  telemetry.guidance_alone = events_.guidanceAlone();
  adaptation_.measure(telemetry, readers_.hasSlowAlone() ? lost : std::nullopt);
  servo_.setLink(adaptation_.jitter(), adaptation_.roundTrip().value_or(0.0));
  if (adaptation_.isLong()) copy_.loadBeside(sceneHash());
  use(adaptation_.chooseModel(copy_.loaded()));
  if (auto chosen = readers_.choose(adaptation_.chooseRates()); !chosen) print(chosen.error().what);
  static_cast<void>(link_.send(telemetry));
}

void StationRunner::takeLoadedScene() {
  const auto outcome = copy_.takeOutcome();
  if (!outcome) return;
  if (!*outcome) return print("no copy of the scene for this long link: " + outcome->error().what);
  for (const auto& [part, matrix] : matrix_) servo_.receive(matrix);
}

void StationRunner::use(ForceModelKind kind) {
  if (kind == force_model_) return;
  force_model_ = kind;
  lockstep_ ? station_.setForceModel(kind) : servo_.setForceModel(kind);
  const std::string text = kind == ForceModelKind::kSceneCopy
                               ? "forces from this station's copy of the scene"
                               : "forces from the contacts that the server lists";
  print(text);
  events_.send(0, "station", text);
}

void StationRunner::readKeys() {
  if (!options_.read_keys || !returnPressed()) return;
  lockstep_ ? station_.press() : servo_.press();
}

void StationRunner::armDevices(const std::atomic<bool>& stop) {
  arming_.start();
  while (lockstep_ && arming_.isUnderWay() && !stop && !over()) hear();
}

/// The forces are off by now, so that another signal may end the program.
void StationRunner::awaitArming(const std::atomic<bool>& stop) {
  if (!arming_.isUnderWay()) return;
  const bool is_by_signal = &stop == &stopFlag();
  if (is_by_signal) endAtNextSignal();
  print(std::string("a device is still being armed: this program ends when it answers") +
        (is_by_signal ? ", or at once with Ctrl-C" : ""));
  arming_.await([this] { hear(); });
}

void StationRunner::printStep(const StepState& step) {
  if (!options_.print || step.phase != StepPhase::kActive || step.instruction.empty()) return;
  const std::string line = std::to_string(step.step + 1) + "/" + std::to_string(step.steps) + " " +
                           localized(step.instruction, options_.language);
  if (line == printed_step_) return;
  printed_step_ = line;
  options_.print(line);
}

/// Those that are due, with as many earlier samples as the link may lose; in lockstep all. Returns how many.
std::uint32_t StationRunner::sendInputs(const StationOutput& output) {
  std::uint32_t sent = 0;
  for (std::size_t i = 0; i < output.inputs.size(); ++i) {
    DeviceInput each = output.inputs[i];
    if (lockstep_) each.period = 1;
    const auto input = adaptation_.due(each, i, output.seq, !lockstep_);
    if (!input) continue;
    static_cast<void>(link_.send(*input));
    ++sent;
  }
  return sent;
}

void StationRunner::send(const StationOutput& output) {
  adaptation_.sent(output.seq, sendInputs(output));
  if (output.seq - stated_seq_ < adaptation_.statePeriod()) return;
  stated_seq_ = output.seq;
  for (std::size_t i = 0; i < output.states.size(); ++i) {
    HandState state = output.states[i];
    state.peak_force = lockstep_ ? peaks_.take(i) : servo_.takePeak(i);
    static_cast<void>(link_.send(state));
  }
}

void StationRunner::sendEvents(std::uint32_t seq) {
  StationEvent event;
  while (lockstep_ ? station_.takeEvent(event) : servo_.takeEvent(event)) events_.receive(event);
  events_.sendDue(seq);
}

Result<void> StationRunner::rejoin(const std::atomic<bool>& stop, bool& new_seat) {
  wire::Membership& member = link_.member();
  const std::string why = *member.lost();
  const auto now = std::chrono::steady_clock::now();
  // two programs that take one seat from each other do so ever more slowly; a server that was killed is no
  // reason
  rejoins_ = member.serverIsGone() ? 0 : now - rejoined_at_ < kMinSeatTime ? rejoins_ + 1 : 1;
  if (!member.isDisplaced())
    print(why + "; rejoining the session" +
          (rejoins_ > kMaxRejoins ? " in 10 s, since it was lost repeatedly" : ""));
  const auto rejoin_at = now + (rejoins_ > kMaxRejoins ? kMinSeatTime : std::chrono::seconds(0));
  while (!stop && std::chrono::steady_clock::now() < rejoin_at) {
    hear();
    armDevices(stop);
  }
  const Welcome before = member.welcome();
  const auto meanwhile = [this, &stop] {
    link_.inbox().dispatch(milliseconds(0));
    readKeys();
    armDevices(stop);
  };
  auto back = member.rejoin(stop, meanwhile);
  if (back) back = link_.awaitMatch(stop, meanwhile);
  if (!back) return fail(why + "; " + back.error().what);
  rejoined_at_ = std::chrono::steady_clock::now();
  adaptation_.interrupted();
  if (member.welcome().server_epoch != before.server_epoch) adaptation_.resetClock();
  new_seat = member.welcome().client != before.client || member.welcome().hands != before.hands ||
             member.welcome().server_epoch != before.server_epoch;
  print("rejoined as client " + std::to_string(member.welcome().client.value));
  if (auto kept = writeSeatKey(options_.seat_file, member.seat()); !kept) print(kept.error().what);
  return {};
}

void StationRunner::restartStation() {
  station_.welcome(link_.welcome(), link_.objects());
  lockstep_ ? copy_.renew() : copy_.renewBeside();
  events_.restart();
  events_.sendDevices();
  if (step_) station_.receive(*step_);
  for (const auto& [part, matrix] : matrix_) station_.receive(matrix);
}

Result<RunState> StationRunner::runLockstep(const std::atomic<bool>& stop) {
  auto seq = static_cast<std::uint32_t>(link_.welcome().tick);
  auto run = takePartInLockstep(stop, seq);
  station_.finish(true);
  for (int i = 0; i < kFinishSteps && !station_.finished(); ++i) station_.step(++seq);
  awaitArming(stop);
  station_.end();
  return run;
}

Result<RunState> StationRunner::takePartInLockstep(const std::atomic<bool>& stop, std::uint32_t& seq) {
  Tick tick = link_.welcome().tick;
  StationOutput output;
  while (!stop && !over()) {
    if (!seated()) {
      bool new_seat = false;
      if (auto back = rejoin(stop, new_seat); !back) return fail(back.error().what);
      if (new_seat) restartStation();
      tick = link_.welcome().tick;
      answers_.reset();
    }
    armDevices(stop);
    if (arming_.isUnderWay()) break;
    seq = static_cast<std::uint32_t>(tick + 1);
    station_.step(seq);
    output.fill(station_, seq);
    peaks_.add(output);
    send(output);
    sendEvents(seq);
    ++tick;
    auto repeat_at = std::chrono::steady_clock::now() + kRepeatAfter;
    while (!answers_.complete(tick, station_.hands()) && !stop && !over() && seated()) {
      link_.inbox().dispatch(milliseconds(50));
      readKeys();
      if (std::chrono::steady_clock::now() < repeat_at) continue;
      sendInputs(output);
      repeat_at = std::chrono::steady_clock::now() + kRepeatAfter;
    }
  }
  return run_;
}

Result<RunState> StationRunner::runRealTime(const std::atomic<bool>& stop) {
  if (options_.real_time) print(threads::lockMemory());
  if (const std::string pacer = station_.pacedBy(); !pacer.empty()) print("the loop is paced by " + pacer);
  servo_thread_.start();
  const std::string not_granted = servo_thread_.notGranted();
  print(not_granted);
  if (options_.real_time)
    if (const std::string missing = wire::raiseWireThreads(); not_granted.empty()) print(missing);
  auto run = takePart(stop);
  copy_.cancel();
  servo_thread_.stop(true);
  awaitArming(stop);
  station_.end();
  char silence[64];
  std::snprintf(silence, sizeof silence, "longest time without contacts of the server: %.1f ms",
                1e3 * servo_.statistics().longest_silence);
  print(silence);
  return run;
}

Result<RunState> StationRunner::takePart(const std::atomic<bool>& stop) {
  bool must_restart = false;  // with a new seat
  while (!stop && !over()) {
    hear();
    if (!must_restart) armDevices(stop);
    if (!seated() && !over()) {
      // the loop continues; forces fade with the age of the contacts
      bool new_seat = false;
      if (auto back = rejoin(stop, new_seat); !back) return fail(back.error().what);
      if (new_seat && arming_.isUnderWay())
        print("the session continues once a device that is being armed answers");
      must_restart = must_restart || new_seat;
    }
    // meanwhile the loop obeys stops, and no force outlives the age of its contacts
    if (must_restart && arming_.isUnderWay()) continue;
    if (std::exchange(must_restart, false)) {
      servo_thread_.stop(false);
      restartStation();
      armDevices(stop);
      servo_thread_.start();
    }
    takeLoadedScene();
    if (const StationOutput* const output = servo_.takeOutput()) {
      send(*output);
      output_seq_ = output->seq;
    }
    sendEvents(output_seq_);
    adaptation_.askClock();
    if (const Telemetry* const statistics = servo_.takeTelemetry()) {
      Telemetry telemetry = *statistics;
      telemetry.loop_overruns = servo_thread_.lateCycles();
      sendTelemetry(telemetry);
    }
  }
  return run_;
}

void onSignal(int /*signal*/) { stopFlag() = true; }
}  // namespace

void endAtNextSignal() {
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
}

const std::atomic<bool>& stopSignal() {
  static const bool installed = [] {
    stopFlag() = false;
    std::signal(SIGINT, onSignal);
    std::signal(SIGTERM, onSignal);
    return true;
  }();
  static_cast<void>(installed);
  return stopFlag();
}

Result<RunState> runStation(Station& station, const StationProgramOptions& options,
                            const std::atomic<bool>& stop) {
  wire::MembershipOptions membership = options.membership;
  membership.role = station.role();
  membership.hands = station.handNames();
  membership.stiffness = station.stiffness();
  if (!options.seat_file.empty()) membership.seat = readSeatKey(options.seat_file);
  auto link = StationLink::open(membership, stop);
  if (!link) return fail(link.error().what);
  if (options.seated) options.seated();
  if (options.print) options.print("joined as client " + std::to_string((*link)->welcome().client.value));
  if (auto kept = writeSeatKey(options.seat_file, (*link)->member().seat()); !kept && options.print)
    options.print(kept.error().what);
  if (options.armed) station.press();
  if (options.print && station.arming().awaitsPress())
    options.print(std::string("not armed: ") + wayToArm(options.read_keys, station.hasArmingButton()) +
                  " to switch the forces on");
  auto runner = std::make_unique<StationRunner>(station, **link, options);
  return runner->run(stop);
}

}  // namespace tenon::haptic
