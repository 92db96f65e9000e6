#include "server/session/session_server.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <thread>

#include <fmt/format.h>

#include "idl/threads/cyclic_thread.h"
#include "idl/types/names.h"
#include "server/session/server_wire.h"
#include "server/session/session_lock.h"
#include "server/simulation/governor.h"

namespace tenon::session {
namespace {

using std::chrono::milliseconds;

constexpr auto kFarewell = std::chrono::seconds(10);  // at most, for the last samples to reach all clients
constexpr auto kInputTimeout = std::chrono::seconds(30);  // in lockstep, for the input of a client

std::optional<Role> roleNamed(std::string_view name) {
  for (const Role role : {Role::kAdmin, Role::kInstructor, Role::kTrainee, Role::kObserver, Role::kRecorder})
    if (roleName(role) == name) return role;
  return std::nullopt;
}

/// Hands and roles that must be present before the first tick.
struct StartCondition {
  std::vector<HandId> hands;
  std::vector<Role> roles;

  [[nodiscard]] bool isMet(const SessionRegistry& registry) const {
    return std::all_of(hands.begin(), hands.end(),
                       [&](HandId hand) { return registry.controllerOf(hand).valid(); }) &&
           std::all_of(roles.begin(), roles.end(), [&](Role role) { return registry.isRolePresent(role); });
  }
};

Result<StartCondition> makeStartCondition(const game_control::ScenarioFile& scenario,
                                          const std::vector<std::string>& names) {
  StartCondition all;
  if (names.empty()) all.hands = traineeHands(scenario);
  for (const std::string& name : names) {
    const HandId hand = scenario.handNamed(name);
    const auto role = roleNamed(name);
    if (!hand.valid() && !role)
      return fail(fmt::format("cannot wait for '{}': neither a hand of this scenario nor a role", name));
    if (hand.valid()) {
      all.hands.push_back(hand);
    } else {
      all.roles.push_back(*role);
    }
  }
  return all;
}

/// [0.25 s since 2025] Larger at each start of a server, so that clients recognise frames of an earlier one.
std::uint32_t newServerEpoch() {
  const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
  constexpr std::int64_t kYear2025 = 1'735'689'600;  // [s] since 1970
  return static_cast<std::uint32_t>(4 * (since_1970 / milliseconds(1) / 1000 - kYear2025) +
                                    since_1970 / milliseconds(250) % 4);
}

class Server final : public SessionServer {
 public:
  Server(const LoadedScene& loaded, SessionOptions options, StartCondition start_condition,
         std::uint32_t epoch)
      : options_(std::move(options)),
        start_condition_(std::move(start_condition)),
        simulation_(loaded.scenario, loaded.scene, options_.simulation),
        registry_(*loaded.scenario, epoch, options_.lockstep),
        input_buffer_(loaded.scenario->hands.size()),
        publisher_(loaded.scenario, epoch, options_.lockstep),
        epoch_(epoch),
        governor_(options_.tick_goal) {}

  Result<void> start(const LoadedScene& loaded) {
    auto lock = SessionLock::take(options_.domain, options_.name);
    if (!lock) return fail(lock.error().what);
    lock_.emplace(std::move(*lock));
    auto wire = ServerWire::open({.session = options_.name,
                                  .domain = options_.domain,
                                  .lockstep = options_.lockstep,
                                  .publish_journal = options_.publish_journal,
                                  .server_epoch = epoch_,
                                  .key = options_.key,
                                  .scene_hash = options_.scene_hash,
                                  .stop_file = options_.stop_file},
                                 loaded, registry_, input_buffer_, publisher_);
    if (!wire) return fail(wire.error().what);
    wire_ = std::move(*wire);
    wire_->print = options_.print;
    if (options_.journal.empty()) return {};
    auto journal = Journal::open(options_.journal,
                                 {loaded.scenario->path.string(), options_.detail, fingerprintOf(loaded)});
    if (!journal) return fail(journal.error().what);
    journal_.emplace(std::move(*journal));
    return {};
  }

  Result<SessionReport> run(const std::atomic<bool>& stop) override {
    print(fmt::format("session '{}' is open, waiting for people", options_.name));
    while (!stop && !registry_.stopRequested() && !wire_->replaced() && !start_condition_.isMet(registry_))
      wire_->dispatch(milliseconds(100));
    if (journal_ || options_.publish_journal) fillCheckpointPool();
    if (!stop && !wire_->replaced()) options_.lockstep ? runLockstep(stop) : runRealTime(stop);
    return finish();
  }

 private:
  void runLockstep(const std::atomic<bool>& stop);
  void runRealTime(const std::atomic<bool>& stop);
  bool awaitInputs(const std::atomic<bool>& stop);
  void realTimeTick() noexcept;
  Result<SessionReport> finish();
  void writeJournal(const JournalEntry& entry);
  void print(const std::string& text) const {
    if (options_.print) options_.print(text);
  }

  /// One tick, in lockstep and in real time alike.
  void tick(TickInput& input, TickOutput& output) noexcept {
    input_buffer_.collect(simulation_.now() + 1, input);
    if (new_budget_ && input.changes.push_back({.kind = ChangeKind::kBudget, .value = *new_budget_}))
      new_budget_.reset();
    const auto begin = std::chrono::steady_clock::now();
    simulation_.tick(input);
    simulation_.fill(output);
    output.stats.compute_seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    govern(output.stats.compute_seconds);
    output.stats.late_ticks = late_ticks_;
    std::uint32_t oldest = 0;
    for (std::size_t i = 0; i < output.ages.size(); ++i)
      if (output.present[i]) oldest = std::max(oldest, output.ages[i]);
    output.stats.input_age_seconds = oldest * kTickSeconds;
  }

  /// Measured time changes nothing but the input of the next tick, so that journals re-simulate.
  void govern(double seconds) noexcept {
    if (options_.lockstep || options_.tick_goal <= 0.0 || new_budget_) return;
    const simulation::Environment& environment = simulation_.environment();
    const auto budget =
        governor_.update(seconds, environment.work().points_visited, environment.workLimits().points);
    if (budget) new_budget_ = static_cast<double>(*budget);
  }

  void fillEntry(const TickInput& input, std::uint64_t hash, JournalEntry& entry) {
    entry.input = input;
    entry.hash = hash;
    entry.checkpoint.clear();
    if (hasCheckpoint(input.tick) && acquireCheckpointBuffer(entry)) simulation_.save(entry.checkpoint);
  }

  void fillCheckpointPool() {
    while (std::vector<std::uint8_t>* buffer = checkpoint_pool_.beginPush()) {
      buffer->reserve(simulation_.maxSavedBytes());
      checkpoint_pool_.commitPush();
    }
  }
  /// Swaps a preallocated buffer into `entry`; false when the journal thread is seconds behind and has all.
  bool acquireCheckpointBuffer(JournalEntry& entry) {
    std::vector<std::uint8_t>* buffer = checkpoint_pool_.front();
    if (buffer == nullptr) return false;
    entry.checkpoint.swap(*buffer);
    entry.checkpoint.clear();
    checkpoint_pool_.pop();
    return true;
  }
  void releaseCheckpointBuffer(JournalEntry& entry) {
    if (entry.checkpoint.empty()) return;
    checkpoint_pool_.beginPush()->swap(entry.checkpoint);
    checkpoint_pool_.commitPush();
  }

  SessionOptions options_;
  StartCondition start_condition_;
  SessionSimulation simulation_;
  SessionRegistry registry_;
  InputBuffer input_buffer_;
  Publisher publisher_;
  std::uint32_t epoch_;
  simulation::Governor governor_;
  std::optional<double> new_budget_;  ///< [points] for the next tick's input
  std::optional<SessionLock> lock_;
  std::unique_ptr<ServerWire> wire_;
  std::optional<Journal> journal_;
  std::optional<std::string> journal_problem_;
  std::uint64_t late_ticks_ = 0;
  // real time
  threads::SpscQueue<TickOutput> outputs_{64};
  threads::SpscQueue<JournalEntry> entries_{1024};
  /// empty checkpoint buffers, from the journal thread to the tick
  threads::SpscQueue<std::vector<std::uint8_t>> checkpoint_pool_{2};
  TickInput input_;
  TickOutput overflow_output_;  ///< of a tick for which outputs_ is full: not sent
};

void Server::runLockstep(const std::atomic<bool>& stop) {
  TickInput input;
  JournalEntry entry;
  TickOutput output = simulation_.makeOutput();
  while (!stop && !wire_->replaced() && !simulation_.over()) {
    if (!awaitInputs(stop)) break;
    tick(input, output);
    wire_->update(output);
    wire_->send(publisher_.prepare(output));
    fillEntry(input, output.hash, entry);
    writeJournal(entry);
    releaseCheckpointBuffer(entry);
  }
}

/// Waits until a hand is controlled and every controlled hand has an input for the next tick; a client that
/// is silent for 30 s is removed. Returns early when a stop is requested; false: no further tick.
bool Server::awaitInputs(const std::atomic<bool>& stop) {
  while (!stop && !registry_.stopRequested() && !wire_->replaced() && !registry_.anyHandControlled())
    wire_->dispatch(milliseconds(50));
  const auto next = static_cast<std::uint32_t>(simulation_.now() + 1);
  const auto missing = [&]() -> HandId {
    for (std::uint32_t i = 0; i < simulation_.environment().hands().size(); ++i)
      if (registry_.controllerOf(HandId{i}).valid() && wire_->newestSeq(HandId{i}) != next) return HandId{i};
    return {};
  };
  auto deadline = std::chrono::steady_clock::now() + kInputTimeout;
  for (HandId late = missing(); late.valid(); late = missing()) {
    wire_->dispatch(milliseconds(50));
    if (stop || wire_->replaced()) return false;
    if (wire_->takeResendRequest()) wire_->resendLast();
    if (std::chrono::steady_clock::now() < deadline) continue;
    wire_->dismiss(registry_.controllerOf(late), "has been silent for 30 s and is removed from the session");
    deadline = std::chrono::steady_clock::now() + kInputTimeout;
  }
  return true;
}

void Server::realTimeTick() noexcept {
  TickOutput* output = outputs_.beginPush();
  tick(input_, output != nullptr ? *output : overflow_output_);
  const std::uint64_t hash = output != nullptr ? output->hash : overflow_output_.hash;
  if (output != nullptr) outputs_.commitPush();
  if (journal_ || options_.publish_journal) {
    if (JournalEntry* entry = entries_.beginPush()) {
      fillEntry(input_, hash, *entry);
      entries_.commitPush();
    }
  }
  wire_->wake();
}

void Server::runRealTime(const std::atomic<bool>& stop) {
  // allocate all slots before the first tick
  for (std::size_t i = 0; i < outputs_.capacity(); ++i) {
    *outputs_.beginPush() = simulation_.makeOutput();
    outputs_.commitPush();
  }
  while (outputs_.front() != nullptr) outputs_.pop();
  overflow_output_ = simulation_.makeOutput();
  std::atomic<bool> over = false;
  threads::CyclicThread ticker(
      std::make_shared<threads::SteadyClock>(),
      {.name = "tick", .fifo_priority = 70, .prepare = [this] { return simulation_.shareScheduling(); }},
      [&](std::uint64_t) {
        if (over) return;  // no tick after the one that ended the run
        realTimeTick();
        if (simulation_.over()) over = true;
      });
  std::thread journal_thread([&] {
    while (true) {
      const bool last_pass = over;  // no further entries will come
      for (JournalEntry* entry = entries_.front(); entry != nullptr; entry = entries_.front()) {
        writeJournal(*entry);
        releaseCheckpointBuffer(*entry);
        entries_.pop();
      }
      if (last_pass) return;
      std::this_thread::sleep_for(milliseconds(20));
    }
  });
  if (const std::string missing = threads::lockMemory(); !missing.empty()) print(missing);
  ticker.start();
  if (!ticker.notGranted().empty()) print(ticker.notGranted());
  while (!stop && !over && !wire_->replaced()) {
    wire_->dispatch(milliseconds(20));
    for (TickOutput* output = outputs_.front(); output != nullptr; output = outputs_.front()) {
      wire_->update(*output);
      output->stats.late_ticks = ticker.lateTicks();
      wire_->send(publisher_.prepare(*output));
      outputs_.pop();
    }
  }
  ticker.stop();
  late_ticks_ = ticker.lateTicks();
  over = true;
  journal_thread.join();
  for (TickOutput* output = outputs_.front(); output != nullptr; output = outputs_.front()) {
    wire_->update(*output);
    wire_->send(publisher_.prepare(*output));
    outputs_.pop();
  }
}

void Server::writeJournal(const JournalEntry& entry) {
  wire_->send(entry);
  if (!journal_ || journal_problem_) return;
  if (auto written = journal_->write(entry); !written) {
    journal_problem_ = written.error().what;
    print(fmt::format("the journal stops here, the session goes on: {}", *journal_problem_));
  }
}

Result<SessionReport> Server::finish() {
  SessionReport report;
  report.run.phase = simulation_.over() ? simulation_.phase() : RunPhase::kStopped;
  report.run.tick = simulation_.now();
  report.run.final_hash = simulation_.hash();
  report.run.server_epoch = epoch_;
  report.run.reason = simulation_.over() ? publisher_.eventGenerator().runReason() : "stopped";
  report.run.steps_skipped = simulation_.step().skipped;
  report.run.steps_timed_out = simulation_.step().timed_out;
  if (!simulation_.over()) wire_->send(report.run);
  report.late_ticks = late_ticks_;
  report.refused_inputs = wire_->refusedInputs();
  report.dropped_outputs = outputs_.dropped();
  if (journal_)
    if (auto closed = journal_->close(report.run); !closed) return fail(closed.error().what);
  if (wire_->replaced()) return fail(*wire_->replaced());

  wire_->statePublished();
  // let reliable samples arrive before the writers are deleted: a client that has not received the end of the
  // run takes the end of the server for a failure
  wire_->waitForReaders(kFarewell);
  const auto until = std::chrono::steady_clock::now() + milliseconds(500);
  while (std::chrono::steady_clock::now() < until) wire_->dispatch(milliseconds(50));
  return report;
}

}  // namespace

std::vector<HandId> traineeHands(const game_control::ScenarioFile& scenario) {
  std::vector<HandId> hands;
  for (std::uint32_t i = 0; i < scenario.hands.size(); ++i)
    if (scenario.hands[i].role == Role::kTrainee) hands.push_back(HandId{i});
  return hands;
}

Result<void> checkWaitFor(const game_control::ScenarioFile& scenario, const std::vector<std::string>& names) {
  const auto condition = makeStartCondition(scenario, names);
  return condition ? Result<void>() : fail(condition.error().what);
}

Result<std::unique_ptr<SessionServer>> SessionServer::open(const LoadedScene& loaded,
                                                           SessionOptions options) {
  auto start_condition = makeStartCondition(*loaded.scenario, options.wait_for);
  if (!start_condition) return fail(start_condition.error().what);
  options.simulation.needed_hands = start_condition->hands;
  auto server =
      std::make_unique<Server>(loaded, std::move(options), std::move(*start_condition), newServerEpoch());
  if (auto started = server->start(loaded); !started) return fail(started.error().what);
  return server;
}

}  // namespace tenon::session
