#include "clients/console/desk.h"

#include <algorithm>
#include <chrono>
#include <deque>
#include <thread>
#include <utility>

#include "clients/command/command_program.h"
#include "clients/command/parser.h"
#include "idl/types/names.h"
#include "idl/types/printable_text.h"

namespace tenon::console {

namespace {

using std::chrono::milliseconds;
constexpr std::size_t kMaxSeats = 16;
constexpr std::size_t kMaxWaiting = 32;  // requests of a seat
constexpr milliseconds kCollect{10};

/// The word of the command that starts and stops recordings, here; who leads the run may give it.
constexpr std::string_view kRecord = "record";
constexpr std::string_view kNoSeat = "an observer gives no commands: sit down as instructor first";
constexpr std::string_view kLeft = "the seat was left before the server answered";

std::vector<std::pair<std::string, std::optional<CommandKind>>> commandsOf(
    const command::CommandClient& client) {
  std::vector<std::pair<std::string, std::optional<CommandKind>>> all;
  for (const command::CommandWord& word : command::commandWords())
    if (word.command && client.permits(*word.command)) all.emplace_back(word.word, word.command);
  if (client.permits(CommandKind::kStop)) all.emplace_back(kRecord, std::nullopt);
  return all;
}

}  // namespace

/// One person's client of the session.
class Desk::Seat {
 public:
  Seat(ViewerId viewer, wire::MembershipOptions options, std::uint32_t request, const Answer& answer)
      : viewer_(viewer), options_(std::move(options)), answer_(answer) {
    thread_ = std::thread([this, request] {
      refuseWaiting(run(request));
      has_ended_ = true;
    });
  }
  ~Seat() {
    stop_ = true;
    thread_.join();
  }
  Seat(const Seat&) = delete;
  Seat& operator=(const Seat&) = delete;

  /// Fails with a sentence when too many wait, or the seat is no more.
  Result<void> add(std::uint32_t id, command::ParsedCommand command) {
    const std::scoped_lock lock(mutex_);
    if (stop_ || takes_no_more_) return fail(std::string(kNoSeat));
    if (waiting_.size() >= kMaxWaiting) return fail("too many commands wait for the server");
    waiting_.emplace_back(id, std::move(command));
    return {};
  }
  /// What waits is not sent any more, so that nothing clears an emergency stop that came after it.
  void dropWaiting() {
    const std::scoped_lock lock(mutex_);
    for (const auto& [id, command] : std::exchange(waiting_, {}))
      answer_(viewer_, {.id = id,
                        .text = "not sent: the emergency stop came after it",
                        .role = std::string(roleName(options_.role)),
                        .code = std::string(refusalName(Refusal::kStopped))});
  }
  void stop() { stop_ = true; }
  [[nodiscard]] bool isOf(const std::string& session) const { return options_.session == session; }
  [[nodiscard]] bool hasEnded() const { return has_ended_; }
  /// The server has given a role that leads the run.
  [[nodiscard]] bool leads() const { return leads_ && !has_ended_; }

 private:
  using Waiting = std::pair<std::uint32_t, command::ParsedCommand>;

  /// Why the seat is no more.
  std::string run(std::uint32_t request) {
    const std::string role(roleName(options_.role));
    auto client = command::CommandClient::open(options_, stop_);
    if (!client) {
      answer_(viewer_, {request, false, client.error().what, {}});
      return client.error().what;
    }
    leads_ = (*client)->permits(CommandKind::kStop);
    answer_(viewer_, {.id = request, .accepted = true, .role = role, .commands = commandsOf(**client)});
    while (!stop_) {
      (*client)->dispatch(kCollect);
      while (auto waiting = take()) {
        const auto done = (*client)->send(waiting->second, stop_);
        const std::string why = done ? "" : stop_ ? std::string(kLeft) : done.error().what;
        // the server has ended the seat, and its notice has not come
        const bool has_ended = !done && (*client)->refusal() == Refusal::kNotJoined;
        answer_(viewer_, {.id = waiting->first,
                          .accepted = done.has_value(),
                          .text = why,
                          .role = stop_ || has_ended ? "" : role,
                          .code = std::string(refusalName((*client)->refusal()))});
        if (has_ended && !stop_) return endSeat(why);
      }
      if (const auto& lost = (*client)->lost(); lost && !stop_) return endSeat(*lost);
    }
    return std::string(kLeft);
  }
  std::string endSeat(const std::string& why) {
    answer_(viewer_, {.text = why});
    return why;
  }
  void refuseWaiting(const std::string& why) {
    const std::scoped_lock lock(mutex_);
    takes_no_more_ = true;
    for (const auto& [id, command] : std::exchange(waiting_, {})) answer_(viewer_, {id, false, why, {}});
  }
  std::optional<Waiting> take() {
    const std::scoped_lock lock(mutex_);
    if (waiting_.empty() || stop_) return std::nullopt;
    std::optional<Waiting> first(std::move(waiting_.front()));
    waiting_.pop_front();
    return first;
  }

  ViewerId viewer_;
  wire::MembershipOptions options_;
  const Answer& answer_;
  std::mutex mutex_;
  std::deque<Waiting> waiting_;
  bool takes_no_more_ = false;
  std::atomic<bool> stop_{false};
  std::atomic<bool> has_ended_{false}, leads_{false};
  std::thread thread_;
};

Desk::Desk(SeatRights rights, std::filesystem::path recordings, std::filesystem::path assets, Answer answer)
    : rights_(std::move(rights)),
      answer_(std::move(answer)),
      recordings_(std::move(recordings), std::move(assets), rights_.domain, answer_) {}

/// All end together, instead of one after the other.
Desk::~Desk() {
  for (const auto& [viewer, seat] : seats_) seat->stop();
  for (const auto& [session, stopper] : stoppers_) stopper->stop();
}

void Desk::expect(const std::set<std::string>& sessions) {
  std::vector<std::unique_ptr<Stopper>> ended;  // their threads end without the lock
  const std::scoped_lock lock(mutex_);
  for (const std::string& session : sessions) static_cast<void>(stopperOf(session));
  for (auto known = stoppers_.begin(); known != stoppers_.end();) {
    const auto current = known++;
    if (sessions.contains(current->first) || !current->second->isIdle()) continue;
    ended.push_back(std::move(current->second));
    stoppers_.erase(current);
  }
}

Stopper& Desk::stopperOf(const std::string& session) {
  auto& stopper = stoppers_[session];
  if (stopper == nullptr) stopper = std::make_unique<Stopper>(rights_.domain, session, answer_);
  return *stopper;
}

void Desk::handle(ViewerId viewer, const std::string& session, const DeskRequest& request) {
  DeskAnswer answer{.id = request.id};
  if (request.kind == DeskRequest::Kind::kSit) {
    if (const auto refusal = sit(viewer, session, request)) answer_(viewer, *refusal);
    return;
  }
  if (request.kind == DeskRequest::Kind::kLeave) {
    leave(viewer);
    answer.accepted = true;
    return answer_(viewer, answer);
  }
  if (!request.words.empty() && request.words.front() == kRecord) return record(viewer, session, request);
  std::vector<std::string> words;
  for (const std::string& word : request.words) words.push_back(printable(word));
  auto parsed = command::parseCommand(words);
  if (!parsed) {
    answer.text = parsed.error().what;
    return answer_(viewer, answer);
  }
  if (parsed->command == CommandKind::kClearEmergencyStop) parsed->value = request.newest_raise;
  const std::scoped_lock lock(mutex_);
  if (!parsed->command) {
    for (const auto& [of, seat] : seats_)
      if (session.empty() || seat->isOf(session)) seat->dropWaiting();
    const std::string reason = parsed->text.empty() ? "requested" : parsed->text;
    if (stopperOf(session).add(viewer, request.id, reason)) return;
    answer.text = "too many emergency stops of this page wait for an answer";
    return answer_(viewer, answer);
  }
  const auto seat = seats_.find(viewer);
  if (seat == seats_.end()) answer.code = "no_seat";
  const auto added =
      seat == seats_.end() ? fail(std::string(kNoSeat)) : seat->second->add(request.id, std::move(*parsed));
  if (added) return;
  answer.text = added.error().what;
  answer_(viewer, answer);
}

/// A seat that leads the run is needed, as for other commands that concern all.
void Desk::record(ViewerId viewer, const std::string& session, const DeskRequest& request) {
  const auto leads = [&] {
    const std::scoped_lock lock(mutex_);
    const auto seat = seats_.find(viewer);
    return seat != seats_.end() && seat->second->leads();
  };
  if (!leads()) {
    return answer_(viewer, {.id = request.id,
                            .text = "recordings are started and stopped by who has a seat as instructor",
                            .code = std::string(refusalName(Refusal::kNotPermitted))});
  }
  recordings_.handle(viewer, session, request);
}

/// The reason of a refusal; a seat that is granted answers by itself.
std::optional<DeskAnswer> Desk::sit(ViewerId viewer, const std::string& session, const DeskRequest& request) {
  DeskAnswer refusal{.id = request.id};
  const auto refuse = [&](std::string why) {
    refusal.text = std::move(why);
    return refusal;
  };
  auto options = membershipOf(rights_, session, request);
  if (!options) return refuse(std::move(options.error().what));
  leave(viewer);
  const std::scoped_lock lock(mutex_);
  std::erase_if(seats_, [](const auto& seat) { return seat.second->hasEnded(); });
  if (seats_.size() + left_.size() >= kMaxSeats) return refuse("all seats of this gateway are taken");
  seats_.emplace(viewer, std::make_unique<Seat>(viewer, std::move(*options), request.id, answer_));
  return std::nullopt;
}

void Desk::left(ViewerId viewer) { leave(viewer); }

void Desk::leave(ViewerId viewer) {
  const std::scoped_lock lock(mutex_);
  std::erase_if(left_, [](const std::unique_ptr<Seat>& seat) { return seat->hasEnded(); });
  const auto seat = seats_.find(viewer);
  if (seat == seats_.end()) return;
  seat->second->stop();
  left_.push_back(std::move(seat->second));
  seats_.erase(seat);
}

}  // namespace tenon::console
