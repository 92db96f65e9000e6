#include "server/session/session_server.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <random>
#include <thread>

#include <fmt/format.h>

#include "idl/threads/cyclic_thread.h"
#include "idl/types/names.h"
#include "server/session/server_wire.h"
#include "server/simulation/governor.h"

namespace tenon {
namespace {

using std::chrono::milliseconds;
using StopWatch = std::chrono::steady_clock;

constexpr auto kPatience = std::chrono::seconds(30);  // for a silent client in lockstep

std::optional<Role> roleNamed(std::string_view name) {
  for (const Role role : {Role::kAdmin, Role::kInstructor, Role::kTrainee, Role::kObserver, Role::kRecorder})
    if (roleName(role) == name) return role;
  return std::nullopt;
}

/// Whom the first step waits for.
struct Awaited {
  std::vector<HandId> hands;
  std::vector<Role> roles;

  [[nodiscard]] bool areHere(const FrontDesk& desk) const {
    return std::all_of(hands.begin(), hands.end(), [&](HandId hand) { return desk.moverOf(hand).valid(); }) &&
           std::all_of(roles.begin(), roles.end(), [&](Role role) { return desk.roleIsHere(role); });
  }
};

Result<Awaited> awaited(const ScenarioFile& scenario, const std::vector<std::string>& names) {
  Awaited all;
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

/// Larger in every life of a server, so that clients know frames of an earlier one: quarters of a second.
std::uint32_t newServerEpoch() {
  const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
  constexpr std::int64_t kYear2025 = 1'735'689'600;  // [s] since 1970
  return static_cast<std::uint32_t>(4 * (since_1970 / milliseconds(1) / 1000 - kYear2025) +
                                    since_1970 / milliseconds(250) % 4);
}

/// Nobody shall guess another one's token.
std::uint64_t newTokenSeed() {
  std::random_device random;
  return std::uint64_t{random()} << 32U | random();
}

class Server final : public SessionServer {
 public:
  Server(const LoadedScene& loaded, SessionOptions options, Awaited awaited, std::uint32_t epoch)
      : options_(std::move(options)),
        awaited_(std::move(awaited)),
        exercise_(loaded.scenario, loaded.scene, options_.exercise),
        desk_(*loaded.scenario, epoch, options_.lockstep, newTokenSeed()),
        intake_(loaded.scenario->hands.size()),
        broadcast_(loaded.scenario, epoch, options_.lockstep),
        epoch_(epoch),
        governor_(options_.tick_goal) {}

  Result<void> start(const LoadedScene& loaded) {
    auto wire = ServerWire::open({.session = options_.name,
                                  .domain = options_.domain,
                                  .lockstep = options_.lockstep,
                                  .publish_journal = options_.publish_journal,
                                  .server_epoch = epoch_},
                                 loaded, desk_, intake_, broadcast_);
    if (!wire) return fail(wire.error().what);
    wire_ = std::move(*wire);
    wire_->say = options_.say;
    if (options_.journal.empty()) return {};
    auto journal = Journal::open(options_.journal,
                                 {loaded.scenario->path.string(), options_.detail, fingerprintOf(loaded)});
    if (!journal) return fail(journal.error().what);
    journal_.emplace(std::move(*journal));
    return {};
  }

  Result<SessionReport> run(const std::atomic<bool>& stop) override {
    say(fmt::format("session '{}' is open, waiting for people", options_.name));
    while (!stop && !desk_.stopIsAsked() && !awaited_.areHere(desk_)) wire_->listen(milliseconds(100));
    if (journal_ || options_.publish_journal) makeRooms();
    if (!stop) options_.lockstep ? runLockstep(stop) : runByTheClock(stop);
    return finish();
  }

 private:
  void runLockstep(const std::atomic<bool>& stop);
  void runByTheClock(const std::atomic<bool>& stop);
  bool awaitInputs(const std::atomic<bool>& stop);
  void tickByTheClock() noexcept;
  Result<SessionReport> finish();
  void writeJournal(const JournalEntry& entry);
  void say(const std::string& text) const {
    if (options_.say) options_.say(text);
  }

  /// One tick: the same in lockstep and by the clock.
  void tick(TickInput& input, TickOutput& output) noexcept {
    intake_.collect(exercise_.now() + 1, input);
    if (new_budget_ && input.changes.push_back({.kind = ChangeKind::kBudget, .value = *new_budget_}))
      new_budget_.reset();
    const auto begin = StopWatch::now();
    exercise_.tick(input);
    exercise_.fill(output);
    output.stats.compute_seconds = std::chrono::duration<double>(StopWatch::now() - begin).count();
    govern(output.stats.compute_seconds);
    output.stats.late_ticks = late_ticks_;
    std::uint32_t oldest = 0;
    for (std::size_t i = 0; i < output.ages.size(); ++i)
      if (output.present[i]) oldest = std::max(oldest, output.ages[i]);
    output.stats.input_age_seconds = oldest * kTickSeconds;
  }

  /// What the clock says changes only the next tick's input.
  void govern(double seconds) noexcept {
    if (options_.lockstep || options_.tick_goal <= 0.0 || new_budget_) return;
    const Environment& environment = exercise_.environment();
    const auto budget =
        governor_.judge(seconds, environment.work().points_visited, environment.workLimits().points);
    if (budget) new_budget_ = static_cast<double>(*budget);
  }

  void keep(const TickInput& input, std::uint64_t hash, JournalEntry& entry) {
    entry.input = input;
    entry.hash = hash;
    entry.checkpoint.clear();
    if (input.tick % kCheckpointEvery == 1 && takeRoom(entry)) exercise_.save(entry.checkpoint);
  }

  void makeRooms() {
    while (std::vector<std::uint8_t>* room = rooms_.beginPush()) {
      room->reserve(exercise_.mostSavedBytes());
      rooms_.commitPush();
    }
  }
  /// Room for a checkpoint made at start; none when the journal is seconds behind.
  bool takeRoom(JournalEntry& entry) {
    std::vector<std::uint8_t>* room = rooms_.front();
    if (room == nullptr) return false;
    entry.checkpoint.swap(*room);
    entry.checkpoint.clear();
    rooms_.pop();
    return true;
  }
  void giveBackRoom(JournalEntry& entry) {
    if (entry.checkpoint.empty()) return;
    rooms_.beginPush()->swap(entry.checkpoint);
    rooms_.commitPush();
  }

  SessionOptions options_;
  Awaited awaited_;
  Exercise exercise_;
  FrontDesk desk_;
  Intake intake_;
  Broadcast broadcast_;
  std::uint32_t epoch_;
  Governor governor_;
  std::optional<double> new_budget_;  ///< [points] for the next tick's input
  std::unique_ptr<ServerWire> wire_;
  std::optional<Journal> journal_;
  std::optional<std::string> journal_problem_;
  std::uint64_t late_ticks_ = 0;
  // by the clock
  SpscQueue<TickOutput> outputs_{64};
  SpscQueue<JournalEntry> entries_{1024};
  SpscQueue<std::vector<std::uint8_t>> rooms_{2};  ///< for checkpoints, on their way back to the tick
  TickInput input_;
  TickOutput unsent_;
};

void Server::runLockstep(const std::atomic<bool>& stop) {
  TickInput input;
  JournalEntry entry;
  TickOutput output = exercise_.makeOutput();
  while (!stop && !exercise_.over()) {
    if (!awaitInputs(stop)) break;
    tick(input, output);
    wire_->follow(output);
    wire_->send(broadcast_.read(output));
    keep(input, output.hash, entry);
    writeJournal(entry);
    giveBackRoom(entry);
  }
}

/// Waits until somebody moves a hand, and every hand that somebody moves has an input for the next tick.
bool Server::awaitInputs(const std::atomic<bool>& stop) {
  while (!stop && !desk_.stopIsAsked() && !desk_.someoneMovesAHand()) wire_->listen(milliseconds(50));
  const auto next = static_cast<std::uint32_t>(exercise_.now() + 1);
  const auto missing = [&]() -> HandId {
    for (std::uint32_t i = 0; i < exercise_.environment().hands().size(); ++i)
      if (desk_.moverOf(HandId{i}).valid() && wire_->newestSeq(HandId{i}) != next) return HandId{i};
    return {};
  };
  auto deadline = StopWatch::now() + kPatience;
  for (HandId late = missing(); late.valid(); late = missing()) {
    wire_->listen(milliseconds(50));
    if (stop) return false;
    if (wire_->takeRepeatWish()) wire_->sendAgain();
    if (StopWatch::now() < deadline) continue;
    wire_->dismiss(desk_.moverOf(late), "has been silent for 30 s and is taken out of the session");
    deadline = StopWatch::now() + kPatience;
  }
  return true;
}

void Server::tickByTheClock() noexcept {
  TickOutput* output = outputs_.beginPush();
  tick(input_, output != nullptr ? *output : unsent_);
  const std::uint64_t hash = output != nullptr ? output->hash : unsent_.hash;
  if (output != nullptr) outputs_.commitPush();
  if (journal_ || options_.publish_journal) {
    if (JournalEntry* entry = entries_.beginPush()) {
      keep(input_, hash, *entry);
      entries_.commitPush();
    }
  }
  wire_->wake();
}

void Server::runByTheClock(const std::atomic<bool>& stop) {
  // every slot gets its room now, none in a tick
  for (std::size_t i = 0; i < outputs_.capacity(); ++i) {
    *outputs_.beginPush() = exercise_.makeOutput();
    outputs_.commitPush();
  }
  while (outputs_.front() != nullptr) outputs_.pop();
  unsent_ = exercise_.makeOutput();
  std::atomic<bool> over = false;
  CyclicThread ticker(std::make_shared<SteadyClock>(), {.name = "tick", .fifo_priority = 70},
                      [&](std::uint64_t) {
                        if (over) return;  // the last tick is the one that ended it
                        tickByTheClock();
                        if (exercise_.over()) over = true;
                      });
  std::thread scribe([&] {
    while (true) {
      const bool last_round = over;  // all ticks are made
      for (JournalEntry* entry = entries_.front(); entry != nullptr; entry = entries_.front()) {
        writeJournal(*entry);
        giveBackRoom(*entry);
        entries_.pop();
      }
      if (last_round) return;
      std::this_thread::sleep_for(milliseconds(20));
    }
  });
  if (const std::string missing = lockMemory(); !missing.empty()) say(missing);
  ticker.start();
  if (!ticker.notGranted().empty()) say(ticker.notGranted());
  while (!stop && !over) {
    wire_->listen(milliseconds(20));
    for (TickOutput* output = outputs_.front(); output != nullptr; output = outputs_.front()) {
      wire_->follow(*output);
      output->stats.late_ticks = ticker.lateTicks();
      wire_->send(broadcast_.read(*output));
      outputs_.pop();
    }
  }
  ticker.stop();
  late_ticks_ = ticker.lateTicks();
  over = true;
  scribe.join();
  for (TickOutput* output = outputs_.front(); output != nullptr; output = outputs_.front()) {
    wire_->send(broadcast_.read(*output));
    outputs_.pop();
  }
}

void Server::writeJournal(const JournalEntry& entry) {
  wire_->send(entry);
  if (!journal_ || journal_problem_) return;
  if (auto written = journal_->write(entry); !written) {
    journal_problem_ = written.error().what;
    say(fmt::format("the journal stops here, the session goes on: {}", *journal_problem_));
  }
}

Result<SessionReport> Server::finish() {
  SessionReport report;
  report.run.phase = exercise_.over() ? exercise_.phase() : RunPhase::kStopped;
  report.run.tick = exercise_.now();
  report.run.final_hash = exercise_.hash();
  report.run.server_epoch = epoch_;
  report.run.reason = report.run.phase == RunPhase::kSucceeded ? "everything is mounted"
                      : report.run.phase == RunPhase::kFailed  ? "a step was not done in time"
                                                               : "stopped";
  if (!exercise_.over()) wire_->send(report.run);
  report.late_ticks = late_ticks_;
  report.refused_inputs = wire_->refusedInputs();
  report.dropped_outputs = outputs_.dropped();
  if (journal_)
    if (auto closed = journal_->close(report.run); !closed) return fail(closed.error().what);

  // the last words must arrive before the writers go
  const auto until = StopWatch::now() + milliseconds(500);
  while (StopWatch::now() < until) wire_->listen(milliseconds(50));
  return report;
}

}  // namespace

std::vector<HandId> traineeHands(const ScenarioFile& scenario) {
  std::vector<HandId> hands;
  for (std::uint32_t i = 0; i < scenario.hands.size(); ++i)
    if (scenario.hands[i].role == Role::kTrainee) hands.push_back(HandId{i});
  return hands;
}

Result<std::unique_ptr<SessionServer>> SessionServer::open(const LoadedScene& loaded,
                                                           SessionOptions options) {
  auto whom = awaited(*loaded.scenario, options.wait_for);
  if (!whom) return fail(whom.error().what);
  options.exercise.needed_hands = whom->hands;
  auto server = std::make_unique<Server>(loaded, std::move(options), std::move(*whom), newServerEpoch());
  if (auto started = server->start(loaded); !started) return fail(started.error().what);
  return server;
}

}  // namespace tenon
