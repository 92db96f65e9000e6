#include "clients/haptic/station_program.h"

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <functional>
#include <future>
#include <map>
#include <optional>
#include <thread>
#include <utility>

#include <poll.h>
#include <unistd.h>

#include "clients/haptic/force_age_statistics.h"
#include "clients/haptic/limit_chooser.h"
#include "clients/haptic/link_clock.h"
#include "clients/haptic/seat_file.h"
#include "clients/haptic/station_link.h"
#include "idl/threads/cyclic_thread.h"
#include "idl/threads/latest.h"
#include "idl/threads/spsc_queue.h"
#include "idl/types/stop_truth.h"

namespace tenon::haptic {

namespace {
using std::chrono::milliseconds;
constexpr std::uint32_t kStatesEvery = 10;       // [ticks] of HandState_100
constexpr std::uint32_t kTelemetryEvery = 1000;  // [ticks]
constexpr milliseconds kRepeatAfter{500};
constexpr int kServoPriority = 75;
constexpr std::int64_t kPeriodNs = 1'000'000;
// After kMaxRejoins rejoins with less than kMinSeatTime between a rejoin and the next loss, wait that long
// before another one: two programs that take each other's seat are not to do so many times a second.
constexpr std::chrono::seconds kMinSeatTime{10};
constexpr int kMaxRejoins = 3;
constexpr milliseconds kFinishAtMost{200};  // for the servo loop to take the forces away

std::int64_t nowNs() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

/// Output of a station in one millisecond.
struct StationOutput {
  std::uint32_t seq = 0;
  FixedVector<DeviceInput, kMaxStationHands> inputs;
  FixedVector<HandState, kMaxStationHands> states;

  void fill(const Station& station, std::uint32_t now) noexcept {
    seq = now;
    inputs.clear();
    states.clear();
    for (const DeviceInput& input : station.inputs()) inputs.push_back(input);
    for (const HandState& state : station.states()) states.push_back(state);
  }
};

/// A step without its texts, so that copying it does not allocate.
StepState withoutTexts(StepState step) {
  step.name = {};
  step.part = {};
  step.title = {};
  step.instruction = {};
  return step;
}

/// Whether a line waits on the terminal: the person has pressed return. Takes it. In the background of a
/// terminal there is none, and who reads there is stopped (SIGTTIN).
bool returnPressed() {
  const pid_t foreground = tcgetpgrp(STDIN_FILENO);  // -1: it is not the terminal of this session
  if (foreground != -1 && foreground != getpgrp()) return false;
  pollfd entry{STDIN_FILENO, POLLIN, 0};
  if (poll(&entry, 1, 0) <= 0 || (entry.revents & POLLIN) == 0) return false;
  char line[256];
  return read(STDIN_FILENO, line, sizeof line) > 0;
}

class StationRunner {
 public:
  StationRunner(Station& station, StationLink& link, const StationProgramOptions& options)
      : station_(station), link_(link), options_(options), model_chooser_(options.force_model) {}

  Result<RunState> run(const std::atomic<bool>& stop) {
    if (auto subscribed = subscribe(); !subscribed) return fail(subscribed.error().what);
    if (auto matched = link_.awaitMatch(stop); !matched) return fail(matched.error().what);
    if (auto taken = takeScene(stop); !taken) return fail(taken.error().what);
    station_.welcome(link_.welcome(), link_.objects());
    return lockstep_ ? runLockstep(stop) : runRealTime(stop);
  }

 private:
  Result<void> subscribe();
  Result<RunState> runLockstep(const std::atomic<bool>& stop);
  Result<RunState> runRealTime(const std::atomic<bool>& stop);
  void servo() noexcept;
  [[nodiscard]] bool tickComplete(Tick tick) const;
  void resetAnswers();
  void notePeaks(const StationOutput& output) noexcept;
  void send(const StationOutput& output);
  void sendEvents();
  void printStep(const StepState& step);
  [[nodiscard]] Result<void> subscribeToStops();
  [[nodiscard]] Result<void> subscribeToClock();
  [[nodiscard]] Result<void> takeScene(const std::atomic<bool>& stop);
  void loadScene();
  void takeLoadedScene();
  void chooseForceModel(double round_trip, std::uint64_t late_cycles);
  void sendInputs(const StationOutput& output);
  void sendTelemetry(Telemetry telemetry);
  void passStops();
  void readKeys();
  void armDevices();
  [[nodiscard]] bool seated() const { return !link_.member().lost(); }
  /// Rejoins. `new_seat`: client, hands or server epoch differ from before, so the station has to restart.
  [[nodiscard]] Result<void> rejoin(const std::atomic<bool>& stop, bool& new_seat);
  void restartStation();
  /// Stops the servo loop, of which the last cycles take the forces away; with `disarms` the devices are off.
  void stopServo(std::optional<threads::CyclicThread>& thread, bool disarms);
  [[nodiscard]] Result<RunState> takePart(std::optional<threads::CyclicThread>& thread,
                                          const std::function<void()>& start_servo,
                                          const std::atomic<bool>& stop);
  [[nodiscard]] Result<RunState> takePartInLockstep(const std::atomic<bool>& stop);
  void print(const std::string& text) const {
    if (options_.print && !text.empty()) options_.print(text);
  }
  [[nodiscard]] bool over() const { return isOver(run_.phase); }

  Station& station_;
  StationLink& link_;
  const StationProgramOptions& options_;
  bool lockstep_ = false;  // messages go directly to the station instead of to the servo's queues
  RunState run_;
  std::array<std::atomic<float>, kMaxStationHands>
      peak_forces_{};             ///< [N] displayed since the last HandState, by state
  std::uint32_t stated_seq_ = 0;  ///< of the last HandState
  std::future<void> arming_;
  enum class Finish { kNot, kRest, kDisarm, kDone };
  std::atomic<Finish> finish_{Finish::kNot};  ///< kDone: by the servo; the others: by the wire thread
  int rejoins_ = 0;
  std::chrono::steady_clock::time_point rejoined_at_{};
  std::optional<StepState> step_;
  std::map<std::uint32_t, CollisionMatrix> matrix_;  // by part
  bool has_scene_ = false, scene_missing_ = false;
  std::atomic<bool> loading_over_{false};
  std::future<Result<void>> loading_;
  ForceModelChooser model_chooser_;
  std::uint64_t late_cycles_ = 0;  // of the servo, as the last Telemetry has them
  std::atomic<ForceModelKind> force_model_{ForceModelKind::kManifold};  // for the servo

  // received parts of the newest tick, in lockstep
  Tick frame_tick_ = 0;
  std::uint64_t frame_parts_ = 0;
  std::uint32_t frame_parts_expected_ = 0;
  std::uint32_t frame_revision_ = 0;
  std::uint32_t step_revision_ = 0;
  std::map<HandId, Tick> manifold_ticks_;

  // between servo and wire
  threads::SpscQueue<WorldFrame> frames_{128};
  threads::SpscQueue<HandManifold> manifolds_{128};
  threads::SpscQueue<Guidance> guidances_{64};
  threads::SpscQueue<StepState> steps_{16};
  threads::SpscQueue<CollisionMatrix> matrices_{16};
  threads::Latest<StopSignal> stop_;
  threads::SpscQueue<bool> presses_{16};
  threads::SpscQueue<StationEvent> events_{256};
  threads::Latest<StationOutput> output_;
  threads::Latest<Telemetry> telemetry_;
  StopTruth stops_;                              // of the wire thread
  LinkClock link_clock_;                         // of the wire thread
  LimitChooser limits_;                          // likewise
  std::atomic<std::uint32_t> playout_ticks_{0};  // LinkChoice::playout_ticks
  std::atomic<double> link_jitter_{0.0};         // [s] for the servo
  ForceAgeStatistics force_age_;
  std::uint32_t seq_ = 0;
  std::int64_t last_cycle_ = 0;  // [ns]
  std::uint64_t event_seq_ = 0;
  std::string printed_step_;
};

Result<void> StationRunner::subscribe() {
  lockstep_ = link_.welcome().lockstep;
  wire::Partition& session = link_.member().session();
  wire::Inbox& inbox = link_.inbox();
  Result<void> all = inbox.on<WorldFrame>(session, wire::kWorldFrame1k, [this](const WorldFrame& frame) {
    if (!lockstep_) return static_cast<void>(frames_.push(frame));
    if (frame.tick > frame_tick_) {
      frame_tick_ = frame.tick;
      frame_parts_ = 0;
    }
    if (frame.tick == frame_tick_) frame_parts_ |= std::uint64_t{1} << frame.part;
    frame_parts_expected_ = frame.parts;
    frame_revision_ = frame.step_revision;
    station_.receive(frame);
  });
  if (all) {
    all = inbox.on<HandManifold>(session, wire::kHandManifold, [this](const HandManifold& manifold) {
      if (!lockstep_) return static_cast<void>(manifolds_.push(manifold));
      manifold_ticks_[manifold.hand] = manifold.tick;
      station_.receive(manifold);
    });
  }
  if (all) {
    all = inbox.on<Guidance>(session, wire::kGuidance, [this](const Guidance& guidance) {
      if (lockstep_) return static_cast<void>(station_.receive(guidance));
      guidances_.push(guidance);
    });
  }
  if (all) {
    all = inbox.on<StepState>(session, wire::kStepState, [this](const StepState& step) {
      step_revision_ = step.revision;
      printStep(step);
      step_ = withoutTexts(step);
      if (lockstep_) return station_.receive(step);
      steps_.push(*step_);
    });
  }
  if (all) {
    all = inbox.on<CollisionMatrix>(session, wire::kCollisionMatrix, [this](const CollisionMatrix& matrix) {
      matrix_[matrix.part] = matrix;
      if (lockstep_) return station_.receive(matrix);
      matrices_.push(matrix);
    });
  }
  if (all) all = subscribeToStops();
  if (all && !lockstep_) all = subscribeToClock();
  if (all) all = inbox.on<RunState>(session, wire::kRunState, [this](const RunState& run) { run_ = run; });
  return all;
}

/// In real time alone: the time of a session in lockstep is that of its ticks.
Result<void> StationRunner::subscribeToClock() {
  return link_.inbox().onFrom<ClockSync>(
      link_.member().session(), wire::kClockSync, [this](const ClockSync& answer, const wire::Origin& from) {
        if (answer.client != link_.welcome().client || answer.server_sent_ns == 0) return;
        if (link_.member().isServer(from)) link_clock_.receive(answer, nowNs());
      });
}

void StationRunner::sendTelemetry(Telemetry telemetry) {
  telemetry.client = link_.welcome().client;
  link_clock_.fill(telemetry, nowNs());
  const LinkChoice choice = limits_.step({.input_gap = telemetry.input_gap,
                                          .trip_jitter = telemetry.trip_jitter,
                                          .age_jitter = telemetry.jitter,
                                          .inputs_lost = telemetry.inputs_lost});
  telemetry.limits = choice.limits;
  playout_ticks_ = telemetry.playout_ticks = choice.playout_ticks;
  link_jitter_ = choice.jitter;
  const std::uint64_t late = telemetry.loop_overruns - std::exchange(late_cycles_, telemetry.loop_overruns);
  chooseForceModel(telemetry.clock_known ? telemetry.round_trip : 0.0, late);
  static_cast<void>(link_.send(telemetry));
}

/// Before the first step, if the copy was asked for. Fails when it cannot be had.
Result<void> StationRunner::takeScene(const std::atomic<bool>& stop) {
  if (options_.force_model != ForceModelWish::kSceneCopy) return {};
  auto scene = openScene(options_.scene, link_.member().announce().scene_hash, options_.print, stop);
  if (!scene) return fail("--force-model scene-copy: " + scene.error().what);
  station_.setScene(*scene);
  has_scene_ = true;
  chooseForceModel(0.0, 0);
  return {};
}

/// Once, when the link turns out to be long: reads or fetches the scene and makes the hands' copies of it,
/// while the session continues.
void StationRunner::loadScene() {
  if (options_.force_model != ForceModelWish::kAuto || loading_.valid() || has_scene_ || scene_missing_)
    return;
  loading_ =
      std::async(std::launch::async, [this, hash = link_.member().announce().scene_hash]() -> Result<void> {
        auto scene = openScene(options_.scene, hash, {}, loading_over_);
        if (!scene) return fail(scene.error().what);
        station_.setScene(*scene);
        return {};
      });
}

void StationRunner::takeLoadedScene() {
  if (!loading_.valid() || loading_.wait_for(milliseconds(0)) != std::future_status::ready) return;
  const Result<void> loaded = loading_.get();
  scene_missing_ = !loaded;
  if (!loaded) return print("no copy of the scene for this long link: " + loaded.error().what);
  has_scene_ = true;
  for (const auto& [part, matrix] : matrix_) matrices_.push(matrix);
}

void StationRunner::chooseForceModel(double round_trip, std::uint64_t late_cycles) {
  if (round_trip > ForceModelChooser::kLong) loadScene();
  const ForceModelKind kind = model_chooser_.step(round_trip, has_scene_, late_cycles);
  if (kind == force_model_) return;
  force_model_ = kind;
  if (lockstep_) station_.setForceModel(kind);
  const std::string text = kind == ForceModelKind::kSceneCopy
                               ? "forces from this station's copy of the scene"
                               : "forces from the contacts that the server lists";
  print(text);
  static_cast<void>(link_.send(ClientEvent{link_.welcome().client, ++event_seq_, 0, "station", text}));
}

/// Raises are heard from anybody, without a server too; clears from the server of this station alone.
Result<void> StationRunner::subscribeToStops() {
  wire::Partition& session = link_.member().session();
  wire::Inbox& inbox = link_.inbox();
  auto heard = inbox.on<EmergencyStop>(session, wire::kEmergencyStop, [this](const EmergencyStop& stop) {
    if (!stops_.raise(stop)) return;
    passStops();
    print("emergency stop by " + stop.who + ": " + stop.reason);
    static_cast<void>(link_.send(stop));
  });
  if (!heard) return heard;
  return inbox.on<EmergencyClear>(session, wire::kEmergencyClear, [this](const EmergencyClear& cleared) {
    const auto raise = stops_.standing().find({cleared.client_guid, cleared.counter});
    const bool stood = raise != stops_.standing().end();
    if (stood) static_cast<void>(link_.withdraw(raise->second));
    stops_.clear(cleared);
    if (!stood) return;
    passStops();
    print("emergency stop cleared by " + cleared.who + ": " + cleared.reason);
    if (!stops_.engaged() && options_.read_keys) print("press return to continue at this station");
  });
}

void StationRunner::passStops() {
  const StopSignal stop{stops_.raised(), stops_.engaged()};
  if (lockstep_) return station_.receive(stop);
  stop_.write(stop);
}

void StationRunner::readKeys() {
  if (!options_.read_keys || !returnPressed()) return;
  if (lockstep_) return station_.press();
  presses_.push(true);
}

/// Devices may take their time, and say why not. In real time they do so on a thread of their own, since this
/// one hears the emergency stop; in lockstep between two steps.
void StationRunner::armDevices() {
  const auto arm = [this] {
    auto armed = station_.armDevices();
    if (!armed) print(armed.error().what);
  };
  if (lockstep_) return arm();
  if (arming_.valid() && arming_.wait_for(milliseconds(0)) != std::future_status::ready) return;
  if (station_.wantsArming()) arming_ = std::async(std::launch::async, arm);
}

void StationRunner::printStep(const StepState& step) {
  if (!options_.print || step.phase != StepPhase::kActive || step.instruction.empty()) return;
  const std::string line = std::to_string(step.step + 1) + "/" + std::to_string(step.steps) + " " +
                           localized(step.instruction, options_.language);
  if (line == printed_step_) return;
  printed_step_ = line;
  options_.print(line);
}

bool StationRunner::tickComplete(Tick tick) const {
  if (frame_tick_ != tick || frame_parts_expected_ == 0) return false;
  if (frame_parts_ != (std::uint64_t{1} << frame_parts_expected_) - 1) return false;
  if (step_revision_ < frame_revision_) return false;
  for (const HandId hand : station_.hands()) {
    const auto received = manifold_ticks_.find(hand);
    if (received == manifold_ticks_.end() || received->second != tick) return false;
  }
  return true;
}

/// Of the former life of a server, whose ticks a resumed one computes again.
void StationRunner::resetAnswers() {
  frame_tick_ = 0;
  frame_parts_ = 0;
  frame_parts_expected_ = 0;
  manifold_ticks_.clear();
}

/// In each cycle of the loop, since the wire thread does not see all outputs.
void StationRunner::notePeaks(const StationOutput& output) noexcept {
  for (std::size_t i = 0; i < output.states.size(); ++i) {
    const auto force = static_cast<float>(output.states[i].F_Ho_W.force.norm());
    float peak = peak_forces_[i].load(std::memory_order_relaxed);
    // the wire thread alone competes, once in a HandState: two tries suffice
    for (int tries = 0; tries < 2 && force > peak; ++tries)
      if (peak_forces_[i].compare_exchange_strong(peak, force, std::memory_order_relaxed)) break;
  }
}

/// With as many earlier samples as the link may lose.
void StationRunner::sendInputs(const StationOutput& output) {
  for (DeviceInput input : output.inputs) {
    input.earlier.resize(std::min<std::size_t>(input.earlier.size(), playout_ticks_.load()));
    static_cast<void>(link_.send(input));
  }
}

void StationRunner::send(const StationOutput& output) {
  sendInputs(output);
  link_clock_.sent(output.seq, static_cast<std::uint32_t>(output.inputs.size()));
  if (output.seq - stated_seq_ < kStatesEvery) return;
  stated_seq_ = output.seq;
  for (std::size_t i = 0; i < output.states.size(); ++i) {
    HandState state = output.states[i];
    state.peak_force = peak_forces_[i].exchange(0.0F, std::memory_order_relaxed);
    static_cast<void>(link_.send(state));
  }
}

void StationRunner::sendEvents() {
  StationEvent event;
  while (events_.pop(event)) {
    const std::string text = station_.describe(event);
    const bool is_safety =
        event.kind == StationEventKind::kSafetyBegan || event.kind == StationEventKind::kSafetyEnded;
    const char* kind = is_safety ? "safety" : "station";
    static_cast<void>(link_.send(ClientEvent{link_.welcome().client, ++event_seq_, event.tick, kind, text}));
    if (event.kind == StationEventKind::kGuidanceBegan || event.kind == StationEventKind::kGuidanceEnded)
      print(text);
    if (event.kind != StationEventKind::kDeviceFault) continue;
    print(text + (options_.read_keys ? "; look at the device, then press return to reset it" : ""));
  }
}

Result<void> StationRunner::rejoin(const std::atomic<bool>& stop, bool& new_seat) {
  wire::Membership& member = link_.member();
  const std::string why = *member.lost();
  const auto now = std::chrono::steady_clock::now();
  rejoins_ = now - rejoined_at_ < kMinSeatTime ? rejoins_ + 1 : 1;
  print(why + "; rejoining the session" +
        (rejoins_ > kMaxRejoins ? " in 10 s, since it was lost repeatedly" : ""));
  const auto rejoin_at = now + (rejoins_ > kMaxRejoins ? kMinSeatTime : std::chrono::seconds(0));
  while (!stop && std::chrono::steady_clock::now() < rejoin_at) {
    link_.inbox().dispatch(milliseconds(20));
    readKeys();
    armDevices();
  }
  const Welcome before = member.welcome();
  const auto meanwhile = [this] {
    link_.inbox().dispatch(milliseconds(0));
    readKeys();
    armDevices();
  };
  auto back = member.rejoin(stop, meanwhile);
  if (back) back = link_.awaitMatch(stop, meanwhile);
  if (!back) return fail(why + "; " + back.error().what);
  rejoined_at_ = std::chrono::steady_clock::now();
  limits_.interrupted();
  if (member.welcome().server_epoch != before.server_epoch) link_clock_ = {};  // another process, or machine
  new_seat = member.welcome().client != before.client || member.welcome().hands != before.hands ||
             member.welcome().server_epoch != before.server_epoch;
  print("rejoined as client " + std::to_string(member.welcome().client.value));
  if (auto kept = writeSeatKey(options_.seat_file, member.seat()); !kept) print(kept.error().what);
  return {};
}

/// Before anything that may block: a device holds its last command.
void StationRunner::stopServo(std::optional<threads::CyclicThread>& thread, bool disarms) {
  finish_ = disarms ? Finish::kDisarm : Finish::kRest;
  const auto until = std::chrono::steady_clock::now() + kFinishAtMost;
  while (finish_ != Finish::kDone && std::chrono::steady_clock::now() < until)
    std::this_thread::sleep_for(milliseconds(1));
  thread.reset();
  finish_ = Finish::kNot;
  if (!disarms) return;
  if (arming_.valid()) arming_.wait();
  station_.end();
}

void StationRunner::restartStation() {
  if (arming_.valid()) arming_.wait();
  station_.welcome(link_.welcome(), link_.objects());
  if (step_) station_.receive(*step_);
  for (const auto& [part, matrix] : matrix_) station_.receive(matrix);
}

Result<RunState> StationRunner::runLockstep(const std::atomic<bool>& stop) {
  auto run = takePartInLockstep(stop);
  station_.finish(true);
  for (int i = 0; i < kFinishAtMost / milliseconds(1) && !station_.finished(); ++i) station_.step(++seq_);
  station_.end();
  return run;
}

Result<RunState> StationRunner::takePartInLockstep(const std::atomic<bool>& stop) {
  Tick tick = link_.welcome().tick;
  StationOutput output;
  StationEvent event;
  while (!stop && !over()) {
    if (!seated()) {
      bool new_seat = false;
      if (auto back = rejoin(stop, new_seat); !back) return fail(back.error().what);
      if (new_seat) restartStation();
      tick = link_.welcome().tick;
      resetAnswers();
    }
    armDevices();
    seq_ = static_cast<std::uint32_t>(tick + 1);
    station_.step(seq_);
    output.fill(station_, seq_);
    notePeaks(output);
    send(output);
    while (station_.takeEvent(event)) events_.push(event);
    sendEvents();
    ++tick;
    auto repeat_at = std::chrono::steady_clock::now() + kRepeatAfter;
    while (!tickComplete(tick) && !stop && !over() && seated()) {
      link_.inbox().dispatch(milliseconds(50));
      readKeys();
      if (std::chrono::steady_clock::now() < repeat_at) continue;
      sendInputs(output);
      repeat_at = std::chrono::steady_clock::now() + kRepeatAfter;
    }
  }
  return run_;
}

void StationRunner::servo() noexcept {
  const std::int64_t now = nowNs();
  while (const WorldFrame* frame = frames_.front()) {
    station_.receive(*frame);
    frames_.pop();
  }
  while (const HandManifold* manifold = manifolds_.front()) {
    if (station_.receive(*manifold))
      force_age_.answerReceived(manifold->hand, manifold->tick, manifold->answers_seq, now);
    manifolds_.pop();
  }
  for (; guidances_.front() != nullptr; guidances_.pop()) station_.receive(*guidances_.front());
  while (const StepState* step = steps_.front()) {
    station_.receive(*step);
    steps_.pop();
  }
  for (; matrices_.front() != nullptr; matrices_.pop()) station_.receive(*matrices_.front());
  station_.setForceModel(force_model_);
  if (stop_.update()) station_.receive(stop_.value());
  const Finish finish = finish_;
  if (finish == Finish::kRest || finish == Finish::kDisarm) station_.finish(finish == Finish::kDisarm);
  for (; presses_.front() != nullptr; presses_.pop()) station_.press();
  if (last_cycle_ != 0) station_.setCycle(static_cast<double>(now - last_cycle_) * 1e-9);
  last_cycle_ = now;
  station_.setLinkJitter(link_jitter_);
  station_.setLinkPlayout(playout_ticks_);
  station_.step(++seq_);
  if (finish == Finish::kRest || finish == Finish::kDisarm) {
    Finish asked = finish;
    if (station_.finished()) finish_.compare_exchange_strong(asked, Finish::kDone);
  }
  force_age_.inputSent(seq_, now, kPeriodNs);
  output_.back().fill(station_, seq_);
  notePeaks(output_.back());
  output_.publish();
  StationEvent event;
  while (station_.takeEvent(event)) events_.push(event);
  if (seq_ % kTelemetryEvery == 0) {
    force_age_.fill(telemetry_.back());
    telemetry_.publish();
  }
  link_.inbox().wake();
}

Result<RunState> StationRunner::runRealTime(const std::atomic<bool>& stop) {
  threads::CyclicOptions cyclic;
  cyclic.name = "servo";
  if (options_.real_time) {
    cyclic.fifo_priority = kServoPriority;
    print(threads::lockMemory());
  }
  std::optional<threads::CyclicThread> thread;
  const auto startServo = [&] {
    thread.emplace(std::make_shared<threads::SteadyClock>(), cyclic,
                   [this](std::uint64_t) noexcept { servo(); });
    thread->start();
  };
  startServo();
  print(thread->notGranted());
  if (options_.real_time)
    if (const std::string missing = wire::raiseWireThreads(); thread->notGranted().empty()) print(missing);
  auto run = takePart(thread, startServo, stop);
  loading_over_ = true;
  stopServo(thread, true);
  force_age_.fill(telemetry_.back());
  char silence[64];
  std::snprintf(silence, sizeof silence, "longest time without contacts of the server: %.1f ms",
                1e3 * telemetry_.back().longest_silence);
  print(silence);
  return run;
}

Result<RunState> StationRunner::takePart(std::optional<threads::CyclicThread>& thread,
                                         const std::function<void()>& start_servo,
                                         const std::atomic<bool>& stop) {
  while (!stop && !over()) {
    link_.inbox().dispatch(milliseconds(20));
    readKeys();
    armDevices();
    if (!seated() && !over()) {
      // the servo continues; forces fade with the age of the contacts
      bool new_seat = false;
      if (auto back = rejoin(stop, new_seat); !back) return fail(back.error().what);
      if (new_seat) {
        stopServo(thread, false);
        restartStation();
        start_servo();
      }
    }
    takeLoadedScene();
    if (output_.update()) send(output_.value());
    sendEvents();
    if (ClockSync request; link_clock_.ask(link_.welcome().client, nowNs(), request))
      static_cast<void>(link_.send(request));
    if (!telemetry_.update()) continue;
    Telemetry telemetry = telemetry_.value();
    telemetry.loop_overruns = thread->lateTicks();
    sendTelemetry(telemetry);
  }
  return run_;
}

std::atomic<bool>& stopFlag() {
  static std::atomic<bool> flag{false};
  return flag;
}

void onSignal(int /*signal*/) { stopFlag() = true; }
}  // namespace

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
  if (options.print) options.print("joined as client " + std::to_string((*link)->welcome().client.value));
  if (auto kept = writeSeatKey(options.seat_file, (*link)->member().seat()); !kept && options.print)
    options.print(kept.error().what);
  if (options.armed) station.press();
  if (options.print && station.arming().awaitsPress())
    options.print(options.read_keys ? "not armed: press return to switch the forces on"
                                    : "not armed: start it with --arm to switch the forces on");
  auto runner = std::make_unique<StationRunner>(station, **link, options);
  return runner->run(stop);
}

}  // namespace tenon::haptic
