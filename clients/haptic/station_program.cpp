#include "clients/haptic/station_program.h"

#include <chrono>
#include <csignal>
#include <cstdio>
#include <map>

#include "clients/haptic/force_age.h"
#include "idl/threads/cyclic_thread.h"
#include "idl/threads/latest.h"
#include "idl/threads/spsc_queue.h"

namespace tenon {

namespace {
using std::chrono::milliseconds;
constexpr std::uint32_t kStatesEvery = 10;       // [ticks] of HandState_100
constexpr std::uint32_t kTelemetryEvery = 1000;  // [ticks]
constexpr milliseconds kRepeatAfter{500};
constexpr int kServoPriority = 75;
constexpr std::int64_t kPeriodNs = 1'000'000;

std::int64_t nowNs() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

/// What a station says in one millisecond.
struct Outbox {
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

/// A step without its texts: copying it allocates nothing.
StepState withoutTexts(StepState step) {
  step.name = {};
  step.part = {};
  step.title = {};
  step.instruction = {};
  return step;
}

class Program {
 public:
  Program(Station& station, SessionLink& link, const StationProgramOptions& options)
      : station_(station), link_(link), options_(options) {}

  Result<RunState> run(const std::atomic<bool>& stop) {
    if (auto heard = subscribe(); !heard) return fail(heard.error().what);
    if (auto settled = link_.settle(stop); !settled) return fail(settled.error().what);
    station_.welcome(link_.welcome(), link_.objects());
    const bool lockstep = link_.welcome().lockstep;
    if (options_.lockstep && !lockstep) {
      return fail(
          "the session does not run in lockstep: start the server with --lockstep, or leave it out here");
    }
    return lockstep ? runLockstep(stop) : runByTheClock(stop);
  }

 private:
  Result<void> subscribe();
  Result<RunState> runLockstep(const std::atomic<bool>& stop);
  Result<RunState> runByTheClock(const std::atomic<bool>& stop);
  void servo() noexcept;
  [[nodiscard]] bool heardTick(Tick tick) const;
  void send(const Outbox& outbox);
  void sendEvents();
  void sayStep(const StepState& step);
  [[nodiscard]] Result<RunState> ended() const {
    if (server_gone_ && !over()) return fail("the server of session '" + link_.sessionName() + "' is gone");
    return run_;
  }
  [[nodiscard]] bool over() const {
    return run_.phase == RunPhase::kSucceeded || run_.phase == RunPhase::kFailed ||
           run_.phase == RunPhase::kStopped;
  }

  Station& station_;
  SessionLink& link_;
  const StationProgramOptions& options_;
  bool direct_ = false;  // lockstep: what is heard goes to the station at once
  RunState run_;
  bool server_gone_ = false;

  // what has been heard of the newest tick
  Tick frame_tick_ = 0;
  std::uint64_t frame_parts_ = 0;
  std::uint32_t frame_parts_expected_ = 0;
  std::uint32_t frame_revision_ = 0;
  std::uint32_t step_revision_ = 0;
  std::map<HandId, Tick> manifold_ticks_;

  // between servo and wire
  SpscQueue<WorldFrame> frames_{128};
  SpscQueue<HandManifold> manifolds_{128};
  SpscQueue<StepState> steps_{16};
  SpscQueue<EmergencyStop> stops_{16};
  SpscQueue<StationEvent> events_{256};
  Latest<Outbox> outbox_;
  Latest<Telemetry> age_;
  ForceAge force_age_;
  std::uint32_t seq_ = 0;
  std::uint64_t event_seq_ = 0;
  std::string said_;
};

Result<void> Program::subscribe() {
  direct_ = link_.welcome().lockstep;
  Partition& session = link_.session();
  Inbox& inbox = link_.inbox();
  Result<void> all = inbox.on<WorldFrame>(session, kWorldFrame1k, [this](const WorldFrame& frame) {
    if (!direct_) return static_cast<void>(frames_.push(frame));
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
    all = inbox.on<HandManifold>(session, kHandManifold, [this](const HandManifold& manifold) {
      if (!direct_) return static_cast<void>(manifolds_.push(manifold));
      manifold_ticks_[manifold.hand] = manifold.tick;
      station_.receive(manifold);
    });
  }
  if (all) {
    all = inbox.on<StepState>(session, kStepState, [this](const StepState& step) {
      step_revision_ = step.revision;
      sayStep(step);
      if (direct_) return station_.receive(step);
      steps_.push(withoutTexts(step));
    });
  }
  if (all) {
    all = inbox.on<EmergencyStop>(session, kEmergencyStop, [this](const EmergencyStop& stop) {
      if (options_.say) {
        options_.say((stop.engaged ? "emergency stop by " : "emergency stop released by ") + stop.who + ": " +
                     stop.reason);
      }
      if (direct_) return station_.receive(stop);
      stops_.push({stop.engaged, {}, {}});
    });
  }
  if (all) {
    all = inbox.onGone<SessionAnnounce>(link_.lobby(), kSessionAnnounce, [this](const SessionAnnounce& gone) {
      if (gone.session == link_.sessionName()) server_gone_ = true;
    });
  }
  if (all) all = inbox.on<RunState>(session, kRunState, [this](const RunState& run) { run_ = run; });
  return all;
}

void Program::sayStep(const StepState& step) {
  if (!options_.say || step.phase != StepPhase::kActive || step.instruction.empty()) return;
  const LocalizedText* chosen = &step.instruction.front();
  for (const LocalizedText& text : step.instruction) {
    if (text.language == options_.language) chosen = &text;
  }
  const std::string said =
      std::to_string(step.step + 1) + "/" + std::to_string(step.steps) + " " + chosen->text;
  if (said == said_) return;
  said_ = said;
  options_.say(said);
}

bool Program::heardTick(Tick tick) const {
  if (frame_tick_ != tick || frame_parts_expected_ == 0) return false;
  if (frame_parts_ != (std::uint64_t{1} << frame_parts_expected_) - 1) return false;
  if (step_revision_ < frame_revision_) return false;
  for (const HandId hand : station_.hands()) {
    const auto heard = manifold_ticks_.find(hand);
    if (heard == manifold_ticks_.end() || heard->second != tick) return false;
  }
  return true;
}

void Program::send(const Outbox& outbox) {
  for (const DeviceInput& input : outbox.inputs) static_cast<void>(link_.send(input));
  if (outbox.seq % kStatesEvery != 0) return;
  for (const HandState& state : outbox.states) static_cast<void>(link_.send(state));
}

void Program::sendEvents() {
  StationEvent event;
  while (events_.pop(event)) {
    const std::string text = describe(event);
    const char* kind = event.kind == StationEventKind::kSafety ? "safety" : "station";
    static_cast<void>(link_.send(ClientEvent{link_.welcome().client, ++event_seq_, kind, text}));
  }
}

Result<RunState> Program::runLockstep(const std::atomic<bool>& stop) {
  Tick tick = link_.welcome().tick;
  Outbox outbox;
  StationEvent event;
  while (!stop && !over() && !server_gone_) {
    station_.step(static_cast<std::uint32_t>(tick + 1));
    outbox.fill(station_, static_cast<std::uint32_t>(tick + 1));
    send(outbox);
    while (station_.takeEvent(event)) events_.push(event);
    sendEvents();
    ++tick;
    auto repeat_at = std::chrono::steady_clock::now() + kRepeatAfter;
    while (!heardTick(tick) && !stop && !over() && !server_gone_) {
      link_.inbox().dispatch(milliseconds(50));
      if (std::chrono::steady_clock::now() < repeat_at) continue;
      for (const DeviceInput& input : outbox.inputs) static_cast<void>(link_.send(input));
      repeat_at = std::chrono::steady_clock::now() + kRepeatAfter;
    }
  }
  return ended();
}

void Program::servo() noexcept {
  const std::int64_t now = nowNs();
  while (const WorldFrame* frame = frames_.front()) {
    station_.receive(*frame);
    frames_.pop();
  }
  while (const HandManifold* manifold = manifolds_.front()) {
    force_age_.answered(manifold->answers_seq, now);
    station_.receive(*manifold);
    manifolds_.pop();
  }
  while (const StepState* step = steps_.front()) {
    station_.receive(*step);
    steps_.pop();
  }
  while (const EmergencyStop* stop = stops_.front()) {
    station_.receive(*stop);
    stops_.pop();
  }
  station_.step(++seq_);
  force_age_.sent(seq_, now, kPeriodNs);
  outbox_.back().fill(station_, seq_);
  outbox_.publish();
  StationEvent event;
  while (station_.takeEvent(event)) events_.push(event);
  if (seq_ % kTelemetryEvery == 0) {
    force_age_.fill(age_.back());
    age_.publish();
  }
  link_.inbox().wake();
}

Result<RunState> Program::runByTheClock(const std::atomic<bool>& stop) {
  const auto say = [this](const std::string& text) {
    if (options_.say && !text.empty()) options_.say(text);
  };
  CyclicOptions cyclic;
  cyclic.name = "servo";
  if (options_.real_time) {
    cyclic.fifo_priority = kServoPriority;
    say(lockMemory());
  }
  CyclicThread thread(std::make_shared<SteadyClock>(), cyclic, [this](std::uint64_t) noexcept { servo(); });
  thread.start();
  say(thread.notGranted());
  while (!stop && !over() && !server_gone_) {
    link_.inbox().dispatch(milliseconds(20));
    if (outbox_.update()) send(outbox_.value());
    sendEvents();
    if (!age_.update()) continue;
    Telemetry telemetry = age_.value();
    telemetry.client = link_.welcome().client;
    telemetry.loop_overruns = thread.lateTicks();
    static_cast<void>(link_.send(telemetry));
  }
  thread.stop();
  return ended();
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
  LinkWishes wishes = options.link;
  wishes.role = station.role();
  wishes.hands = station.handNames();
  auto link = SessionLink::join(wishes, stop);
  if (!link) return fail(link.error().what);
  if (options.say) options.say("joined as client " + std::to_string((*link)->welcome().client.value));
  auto program = std::make_unique<Program>(station, **link, options);
  return program->run(stop);
}

}  // namespace tenon
