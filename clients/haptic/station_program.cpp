#include "clients/haptic/station_program.h"

#include <chrono>
#include <csignal>
#include <cstdio>
#include <map>
#include <optional>

#include "clients/haptic/force_age.h"
#include "clients/haptic/seat_file.h"
#include "clients/haptic/station_link.h"
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
// a seat that is lost again and again, each time so soon, is not worth looking for
constexpr std::chrono::seconds kSoon{10};
constexpr int kMostReturns = 3;

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
  Program(Station& station, StationLink& link, const StationProgramOptions& options)
      : station_(station), link_(link), options_(options) {}

  Result<RunState> run(const std::atomic<bool>& stop) {
    if (auto heard = subscribe(); !heard) return fail(heard.error().what);
    if (auto settled = link_.settle(stop); !settled) return fail(settled.error().what);
    station_.welcome(link_.welcome(), link_.objects());
    return direct_ ? runLockstep(stop) : runByTheClock(stop);
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
  [[nodiscard]] bool seated() const { return !link_.member().lost(); }
  /// The same seat again; `fresh` when the server does not know it any more, so that the station starts anew.
  [[nodiscard]] Result<void> comeBack(const std::atomic<bool>& stop, bool& fresh);
  void startAnew();
  void say(const std::string& text) const {
    if (options_.say && !text.empty()) options_.say(text);
  }
  [[nodiscard]] bool over() const {
    return run_.phase == RunPhase::kSucceeded || run_.phase == RunPhase::kFailed ||
           run_.phase == RunPhase::kStopped;
  }

  Station& station_;
  StationLink& link_;
  const StationProgramOptions& options_;
  bool direct_ = false;  // lockstep: what is heard goes to the station at once
  RunState run_;
  int returns_ = 0;
  std::chrono::steady_clock::time_point returned_{};
  std::optional<StepState> step_;

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
  Partition& session = link_.member().session();
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
      step_ = withoutTexts(step);
      if (direct_) return station_.receive(step);
      steps_.push(*step_);
    });
  }
  if (all) {
    all = inbox.onFrom<EmergencyStop>(
        session, kEmergencyStop, [this](const EmergencyStop& stop, const Origin& from) {
          // anybody may stop; that it goes on is believed of the server alone
          if (!stop.engaged && !link_.member().isServer(from)) return;
          say((stop.engaged ? "emergency stop by " : "emergency stop cleared by ") + stop.who + ": " +
              stop.reason);
          if (direct_) return station_.receive(stop);
          stops_.push({stop.engaged, {}, {}});
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
    const std::string text = station_.describe(event);
    const bool is_safety =
        event.kind == StationEventKind::kSafetyBegan || event.kind == StationEventKind::kSafetyEnded;
    const char* kind = is_safety ? "safety" : "station";
    static_cast<void>(link_.send(ClientEvent{link_.welcome().client, ++event_seq_, kind, text}));
  }
}

Result<void> Program::comeBack(const std::atomic<bool>& stop, bool& fresh) {
  Membership& member = link_.member();
  const std::string why = *member.lost();
  const auto now = std::chrono::steady_clock::now();
  returns_ = now - returned_ < kSoon ? returns_ + 1 : 1;
  if (returns_ > kMostReturns) return fail(why);
  say(why + "; looking for the seat");
  const Welcome before = member.welcome();
  auto back = member.comeBack(stop, [this] { link_.inbox().dispatch(milliseconds(0)); });
  if (back) back = link_.settle(stop);
  if (!back) return fail(why + "; " + back.error().what);
  returned_ = std::chrono::steady_clock::now();
  fresh = member.welcome().client != before.client || member.welcome().hands != before.hands ||
          member.welcome().server_epoch != before.server_epoch;
  say("back as client " + std::to_string(member.welcome().client.value));
  if (auto kept = keepToken(options_.seat, member.welcome().token); !kept) say(kept.error().what);
  return {};
}

void Program::startAnew() {
  station_.welcome(link_.welcome(), link_.objects());
  if (step_) station_.receive(*step_);
}

Result<RunState> Program::runLockstep(const std::atomic<bool>& stop) {
  Tick tick = link_.welcome().tick;
  Outbox outbox;
  StationEvent event;
  while (!stop && !over()) {
    if (!seated()) {
      bool fresh = false;
      if (auto back = comeBack(stop, fresh); !back) return fail(back.error().what);
      if (fresh) startAnew();
      tick = link_.welcome().tick;
    }
    station_.step(static_cast<std::uint32_t>(tick + 1));
    outbox.fill(station_, static_cast<std::uint32_t>(tick + 1));
    send(outbox);
    while (station_.takeEvent(event)) events_.push(event);
    sendEvents();
    ++tick;
    auto repeat_at = std::chrono::steady_clock::now() + kRepeatAfter;
    while (!heardTick(tick) && !stop && !over() && seated()) {
      link_.inbox().dispatch(milliseconds(50));
      if (std::chrono::steady_clock::now() < repeat_at) continue;
      for (const DeviceInput& input : outbox.inputs) static_cast<void>(link_.send(input));
      repeat_at = std::chrono::steady_clock::now() + kRepeatAfter;
    }
  }
  return run_;
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
  CyclicOptions cyclic;
  cyclic.name = "servo";
  if (options_.real_time) {
    cyclic.fifo_priority = kServoPriority;
    say(lockMemory());
  }
  std::optional<CyclicThread> thread;
  const auto startServo = [&] {
    thread.emplace(std::make_shared<SteadyClock>(), cyclic, [this](std::uint64_t) noexcept { servo(); });
    thread->start();
  };
  startServo();
  say(thread->notGranted());
  while (!stop && !over()) {
    link_.inbox().dispatch(milliseconds(20));
    if (!seated() && !over()) {
      // the servo goes on meanwhile: what is felt fades with the age of the contacts
      bool fresh = false;
      if (auto back = comeBack(stop, fresh); !back) return fail(back.error().what);
      if (fresh) {
        thread.reset();
        startAnew();
        startServo();
      }
    }
    if (outbox_.update()) send(outbox_.value());
    sendEvents();
    if (!age_.update()) continue;
    Telemetry telemetry = age_.value();
    telemetry.client = link_.welcome().client;
    telemetry.loop_overruns = thread->lateTicks();
    static_cast<void>(link_.send(telemetry));
  }
  thread.reset();
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
  MembershipWishes wishes = options.link;
  wishes.role = station.role();
  wishes.hands = station.handNames();
  if (!options.seat.empty()) wishes.token = readToken(options.seat);
  auto link = StationLink::open(wishes, stop);
  if (!link) return fail(link.error().what);
  if (options.say) options.say("joined as client " + std::to_string((*link)->welcome().client.value));
  if (auto kept = keepToken(options.seat, (*link)->welcome().token); !kept && options.say)
    options.say(kept.error().what);
  auto program = std::make_unique<Program>(station, **link, options);
  return program->run(stop);
}

}  // namespace tenon
