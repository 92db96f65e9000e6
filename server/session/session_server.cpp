#include "server/session/session_server.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "idl/threads/cyclic_thread.h"
#include "idl/wire/network.h"
#include "server/session/command_gate.h"
#include "server/session/journal_writer.h"
#include "server/session/loss_log.h"
#include "server/session/resume.h"
#include "server/session/seat_list.h"
#include "server/session/server_wire.h"
#include "server/session/session_lock.h"
#include "server/session/start_condition.h"
#include "server/session/stop_file.h"
#include "server/simulation/governor.h"

namespace tenon::session {
namespace {

using std::chrono::milliseconds;

constexpr auto kFarewell = std::chrono::seconds(10);  // at most, for the last samples to reach all clients
// for the hands of a resumed session, at most; those who come later get theirs then
constexpr auto kReturn = milliseconds(1500);
constexpr auto kInputTimeout = std::chrono::seconds(30);    // in lockstep, for the input of a client
constexpr auto kStopTimeout = std::chrono::seconds(1);      // likewise, once a command ends the run
constexpr auto kJournalPatience = std::chrono::seconds(1);  // before it is said that its disk is awaited

/// Those to the state machine.
std::uint64_t countCommands(const TickInput& input) noexcept {
  return static_cast<std::uint64_t>(
      std::count_if(input.changes.begin(), input.changes.end(),
                    [](const Change& change) { return change.kind == ChangeKind::kGameCommand; }));
}

/// [0.25 s since 2025] Larger at each start of a server, so that clients recognise frames of an earlier one.
/// Larger than `former`, whatever the clock says.
std::uint32_t newServerEpoch(std::uint32_t former) {
  const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
  constexpr std::int64_t kYear2025 = 1'735'689'600;  // [s] since 1970
  const auto by_clock = static_cast<std::uint32_t>(4 * (since_1970 / milliseconds(1) / 1000 - kYear2025) +
                                                   since_1970 / milliseconds(250) % 4);
  return std::max(by_clock, former + 1);
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
    const auto network = wire::chosenNetwork();
    if (!network) return fail(network.error().what);
    if (const std::string audience = wire::audienceOf(*network); !audience.empty()) {
      registry_.requireKey(!options_.open);
      print(fmt::format("session '{}' is {}; {}", options_.name, audience,
                        options_.open ? "whoever hears it may join as trainee, observer or recorder (--open)"
                                      : "all who join need its key (--open: trainees and observers do not)"));
    }
    auto lock = SessionLock::take(options_.domain, options_.name);
    if (!lock) return fail(lock.error().what);
    lock_.emplace(std::move(*lock));
    if (options_.resume)
      if (auto resumed = resume(loaded); !resumed) return resumed;
    auto wire = ServerWire::open({.session = options_.name,
                                  .domain = options_.domain,
                                  .lockstep = options_.lockstep,
                                  .publish_journal = options_.publish_journal,
                                  .server_epoch = epoch_,
                                  .key = options_.key,
                                  .scene_hash = options_.scene_hash,
                                  .detail = options_.detail,
                                  .limits = options_.simulation.limits,
                                  .resumed_after = resumed_after_,
                                  .stop_file = options_.stop_file,
                                  .seat_file = options_.journal.empty() ? "" : seatFileOf(options_.journal)},
                                 loaded, registry_, input_buffer_, publisher_);
    if (!wire) return fail(wire.error().what);
    wire_ = std::move(*wire);
    if (options_.stop_file.empty()) wire_->log(Severity::kWarning, "emergency stop", kNoStopFile);
    wire_->print = options_.print;
    wire_->logStandingStops();
    if (options_.journal.empty()) {
      if (options_.publish_journal) makeJournalWriter(std::nullopt);
      return {};
    }
    // as the last step: what fails before it leaves the journal of a killed server as it was
    auto journal =
        options_.resume
            ? Journal::reopen(options_.journal, simulation_.now(), epoch_)
            : Journal::open(options_.journal, {loaded.scenario->path.string(), options_.detail,
                                               fingerprintOf(loaded), options_.simulation.limits, epoch_});
    if (!journal) return fail(journal.error().what);
    if (!options_.resume)
      if (const auto copied = journal->copyScenario(*loaded.scenario); !copied)
        print(fmt::format("the journal holds no copy of its scenario: {}", copied.error().what));
    makeJournalWriter(std::move(*journal));
    // a recorder that is back fills with them what it lacks of the former life
    for (const JournalEntry& entry : resumed_entries_) wire_->send(entry);
    resumed_entries_.clear();
    return {};
  }

  Result<SessionReport> run(const std::atomic<bool>& stop) override {
    if (journal_) journal_->reserve(simulation_.maxSavedBytes());
    // killed before the first tick: the session begins when all are there, as it would have
    if (options_.resume && simulation_.now() > 0) {
      awaitReturn(stop);
    } else {
      awaitPeople(stop);
    }
    const bool runs = !stop && !wire_->replaced() && !simulation_.over();
    if (runs) options_.lockstep ? runLockstep(stop) : runRealTime(stop);
    return finish();
  }

 private:
  Result<void> resume(const LoadedScene& loaded);
  void awaitPeople(const std::atomic<bool>& stop);
  void awaitReturn(const std::atomic<bool>& stop);
  void runLockstep(const std::atomic<bool>& stop);
  void runRealTime(const std::atomic<bool>& stop);
  bool awaitInputs(const std::atomic<bool>& stop);
  bool awaitJournal(const std::atomic<bool>& stop);
  void realTimeTick() noexcept;
  /// Publisher::prepare.
  void publish(TickOutput& output, bool is_newest) {
    const WriteCounts writes = wire_->writes();
    output.stats.slow_writes = writes.slow;
    output.stats.unsent_samples = writes.failed;
    wire_->update(output);
    wire_->send(publisher_.prepare(output, is_newest));
  }
  Result<SessionReport> finish();
  void makeJournalWriter(std::optional<Journal> journal);
  void noticeJournal(bool is_last = false);
  void endJournal(SessionReport& report);
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
    commands_taken_ += countCommands(input);
    output.commands.taken = commands_taken_;
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
  std::vector<JournalEntry> resumed_entries_;  ///< the last ones of the journal that is resumed
  Tick resumed_after_ = 0;                     ///< SessionAnnounce::resumed_after
  std::vector<HandId> returning_;  ///< controlled when the server was killed that this one resumes
  std::optional<JournalWriter> journal_;
  bool journal_ended_ = false;  ///< before the session, as was said
  LossLog lost_entries_{"in the journal"};
  LossLog lost_copies_{"in recordings"};
  std::uint64_t late_ticks_ = 0;
  std::uint64_t commands_taken_ = 0;  ///< CommandCounts::taken
  // real time
  threads::SpscQueue<TickOutput> outputs_{64};
  TickInput input_;
  TickOutput overflow_output_;  ///< of a tick for which outputs_ is full: not sent
};

/// Takes up the session of a killed server, before the wire is open.
Result<void> Server::resume(const LoadedScene& loaded) {
  auto point = readResumePoint(options_.journal, loaded, simulation_);
  if (!point) return fail(point.error().what);
  resumed_entries_ = std::move(point->entries);
  if (!point->problem.empty()) print(point->problem);
  if (point->tick > 0)
    print(
        fmt::format("{} reaches tick {} and records no end of the run: what the former server did after that "
                    "tick is lost "
                    "(of a kill some 20 ms, more where its disk hung)",
                    options_.journal.string(), point->tick));
  auto seats = readSeats(seatFileOf(options_.journal));
  if (!seats) print(seats.error().what);
  for (std::uint32_t i = 0; i < loaded.scenario->hands.size(); ++i)
    if (simulation_.isAttached(HandId{i})) returning_.push_back(HandId{i});
  registry_.resume(seats ? *seats : std::vector<KeptSeat>{});
  publisher_.eventGenerator().resume(point->tick);
  resumed_after_ = point->tick;
  return {};
}

/// Waits for the clients that controlled hands when the server was killed.
void Server::awaitReturn(const std::atomic<bool>& stop) {
  TickOutput output = simulation_.makeOutput();
  simulation_.fill(output);
  wire_->update(output);
  // One that the stop file lacks, because it could not be written in time, stands until a person clears it.
  if (simulation_.emergencyStop()) wire_->raiseStop("it stood when the former server was killed");
  print(fmt::format("session '{}' is open again after tick {}", options_.name, simulation_.now()));
  wire_->log(Severity::kWarning, "resumed",
             fmt::format("a new server continues the session after {:.3f} s, as far as its journal reaches",
                         static_cast<double>(simulation_.now()) * kTickSeconds));
  const auto isBack = [this](HandId hand) { return registry_.controllerOf(hand).valid(); };
  const auto until = std::chrono::steady_clock::now() + kReturn;
  while (!stop && !wire_->replaced() && std::chrono::steady_clock::now() < until &&
         !std::all_of(returning_.begin(), returning_.end(), isBack))
    wire_->dispatch(milliseconds(20));
  if (stop) return;
  for (const HandId hand : returning_)
    if (!isBack(hand))
      wire_->log(Severity::kWarning, "hand gone",
                 fmt::format("hand '{}' is not back yet: what it held is parked",
                             simulation_.scenario().hands[hand.value].name));
}

void Server::runLockstep(const std::atomic<bool>& stop) {
  TickInput input;
  TickOutput output = simulation_.makeOutput();
  while (!stop && !wire_->replaced() && !simulation_.over()) {
    if (!awaitInputs(stop)) break;
    tick(input, output);
    // in the file before anybody has the answer, so that no client is ahead of a server that is resumed
    if (journal_) {
      journal_->add(input, output.hash, simulation_);
      if (!awaitJournal(stop)) break;
      noticeJournal();
    }
    publish(output, true);
  }
}

/// Until the tick is in the journal's file; false: it was ended before. Meanwhile messages are handled.
bool Server::awaitJournal(const std::atomic<bool>& stop) {
  std::optional until_told = std::chrono::steady_clock::now() + kJournalPatience;
  std::optional<std::chrono::steady_clock::time_point> until_ended;  // a disk that is slow gets that long
  while (!journal_->isWrittenWithin(milliseconds(20))) {
    const auto now = std::chrono::steady_clock::now();
    if (!until_ended && (stop || registry_.stopRequested())) until_ended = now + kJournalPatience;
    if (wire_->replaced() || (until_ended && now >= *until_ended)) return false;
    if (until_told && now >= *until_told) {
      until_told.reset();
      wire_->log(Severity::kError, "journal",
                 "the session waits for the journal's disk; Ctrl-C ends the session, a second one the wait");
    }
    wire_->dispatch(milliseconds(0));
  }
  return true;
}

/// Waits until a hand is controlled and every controlled hand has an input for the next tick; a client that
/// is silent for 30 s is removed. When a command ends the run, waits for 1 s at most; false: no further tick.
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
  std::optional<std::chrono::steady_clock::time_point> stop_until;
  for (HandId late = missing(); late.valid(); late = missing()) {
    wire_->dispatch(milliseconds(50));
    if (stop || wire_->replaced()) return false;
    if (wire_->takeResendRequest()) wire_->resendLast();
    if (registry_.stopRequested()) {
      // the tick in which the run ends waits for nobody who hangs
      if (!stop_until) stop_until = std::chrono::steady_clock::now() + kStopTimeout;
      if (std::chrono::steady_clock::now() >= *stop_until) return true;
    }
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
  if (journal_) journal_->add(input_, hash, simulation_);
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
  if (journal_) journal_->start();
  if (const std::string missing = threads::lockMemory(); !missing.empty()) print(missing);
  ticker.start();
  if (!ticker.notGranted().empty()) print(ticker.notGranted());
  if (const std::string missing = wire::raiseWireThreads(); !missing.empty() && ticker.notGranted().empty())
    print(missing);
  while (!stop && !over && !wire_->replaced()) {
    wire_->dispatch(milliseconds(20));
    for (TickOutput* output = outputs_.front(); output != nullptr; output = outputs_.front()) {
      output->stats.late_ticks = ticker.lateTicks();
      // every tick is looked at for its events, the newest one is sent
      publish(*output, outputs_.size() == 1);
      outputs_.pop();
    }
    noticeJournal();
  }
  ticker.stop();
  late_ticks_ = ticker.lateTicks();
  over = true;
  for (TickOutput* output = outputs_.front(); output != nullptr; output = outputs_.front()) {
    publish(*output, outputs_.size() == 1);
    outputs_.pop();
  }
  // the queue was full in the last tick, which says how the run ended
  if (overflow_output_.tick == simulation_.now() && simulation_.now() > 0) publish(overflow_output_, true);
  noticeJournal(true);
}

void Server::makeJournalWriter(std::optional<Journal> journal) {
  JournalWriter::Publish publish;
  if (options_.publish_journal)
    publish = [wire = wire_.get()](const JournalEntry& entry) { wire->send(entry); };
  journal_.emplace(std::move(journal), std::move(publish));
}

/// Says what the journal or recorders miss; `is_last`: all that is not said yet.
void Server::noticeJournal(bool is_last) {
  if (!journal_) return;
  if (const auto why = journal_->problem(); why && !std::exchange(journal_ended_, true))
    wire_->log(Severity::kError, "journal",
               fmt::format("the journal ends here, the session continues without it: {}", *why));
  const auto now = std::chrono::steady_clock::now();
  if (!journal_ended_)
    if (const auto lost = lost_entries_.update(journal_->lostEntries(), now, is_last))
      wire_->log(Severity::kError, "journal", *lost + ": the disk or the machine is too slow");
  if (const auto lost = lost_copies_.update(journal_->lostCopies(), now, is_last))
    wire_->log(Severity::kWarning, "journal", *lost + ": a recorder is too slow");
}

void Server::awaitPeople(const std::atomic<bool>& stop) {
  print(fmt::format("session '{}' is open{}, waiting for people", options_.name,
                    options_.resume ? " again" : ""));
  std::optional<std::pair<bool, std::vector<std::string>>>
      published;  // whether a stop stands, and who is missing
  while (!stop && !registry_.stopRequested() && !wire_->replaced() && !start_condition_.isMet(registry_)) {
    std::pair now{registry_.isStopEngaged(), start_condition_.missing(simulation_.scenario(), registry_)};
    if (published != now) {
      wire_->send(publisher_.eventGenerator().runBefore(now.first, now.second));
      published = std::move(now);
    }
    wire_->dispatch(milliseconds(100));
  }
}

/// After the end is published, which waits for no disk.
void Server::endJournal(SessionReport& report) {
  journal_->end(report.run);
  if (!journal_->isEndedWithin(kJournalPatience)) {
    const auto signals = [this] { return options_.signals != nullptr ? options_.signals->load() : 0; };
    const std::uint32_t before = signals();
    print("waiting for the journal's disk; Ctrl-C ends the server without the rest of the journal");
    while (!report.left_journal && !journal_->isEndedWithin(milliseconds(20)))
      report.left_journal = signals() != before || wire_->replaced();
  }
  if (report.left_journal) {
    journal_->leaveFile();
    report.journal_problem = "its disk hangs, so that its end, which says how the run ended, may be missing";
    if (const std::uint64_t waiting = journal_->waitingEntries(); waiting > 0)
      report.journal_problem += fmt::format("; {} ticks still wait for it", waiting);
  } else {
    journal_->stop();
    // a session that is over is over, whatever became of its journal
    report.journal_problem = journal_->problem().value_or("");
  }
  report.lost_journal_ticks = journal_->lostEntries();
}

Result<SessionReport> Server::finish() {
  SessionReport report;
  report.run.phase = simulation_.over() ? simulation_.phase() : RunPhase::kStopped;
  report.run.tick = simulation_.now();
  report.run.final_hash = simulation_.hash();
  report.run.server_epoch = epoch_;
  report.run.emergency_stop = registry_.isStopEngaged();
  report.run.open_commands = openCommands(report.run.phase, report.run.emergency_stop);
  const std::string& reason = publisher_.eventGenerator().runReason();
  // empty: no tick of this life has said the end of a session that had ended when its server was killed
  report.run.reason = !simulation_.over() ? "stopped"
                      : reason.empty()    ? "had ended before the resume"
                                          : reason;
  report.run.steps_skipped = simulation_.step().skipped;
  report.run.steps_timed_out = simulation_.step().timed_out;
  if (!simulation_.over() || reason.empty()) {
    wire_->send(report.run);
    print(fmt::format("run: {}", report.run.reason));
  }
  report.late_ticks = late_ticks_;
  report.refused_inputs = wire_->refusedInputs();
  report.dropped_outputs = outputs_.dropped();
  report.slow_writes = wire_->writes().slow;
  report.failed_writes = wire_->writes().failed;
  report.longest_write = wire_->writes().longest_seconds;
  if (journal_) endJournal(report);
  report.replaced_by = wire_->replaced().value_or("");
  if (wire_->replaced()) return report;

  wire_->statePublished();
  // let reliable samples arrive before the writers are deleted: a client that has not received the end of the
  // run takes the end of the server for a failure
  wire_->waitForReaders(kFarewell);
  const auto until = std::chrono::steady_clock::now() + milliseconds(500);
  while (std::chrono::steady_clock::now() < until) wire_->dispatch(milliseconds(50));
  return report;
}

}  // namespace

Result<std::unique_ptr<SessionServer>> SessionServer::open(const LoadedScene& loaded,
                                                           SessionOptions options) {
  auto start_condition = StartCondition::make(*loaded.scenario, options.wait_for);
  if (!start_condition) return fail(start_condition.error().what);
  options.simulation.needed_hands = start_condition->hands;
  const std::uint32_t epoch = newServerEpoch(options.resume ? lastServerEpoch(options.journal) : 0);
  auto server = std::make_unique<Server>(loaded, std::move(options), std::move(*start_condition), epoch);
  if (auto started = server->start(loaded); !started) return fail(started.error().what);
  return server;
}

}  // namespace tenon::session
