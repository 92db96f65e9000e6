#include "clients/console/desk.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <thread>
#include <utility>

#include "clients/command/command_program.h"
#include "clients/command/parser.h"
#include "clients/command/stop_raiser.h"
#include "idl/types/names.h"

namespace tenon::console {

namespace {

using std::chrono::milliseconds;
constexpr std::size_t kMaxSeats = 16;
constexpr std::size_t kMaxWaiting = 32;  // requests of a seat
constexpr milliseconds kCollect{10};
constexpr milliseconds kForAServer{1500};  // to repeat an emergency stop

}  // namespace

/// One person's client of the session.
class Desk::Seat {
 public:
  Seat(ViewerId viewer, wire::MembershipOptions options, std::uint32_t request, const Answer& answer)
      : viewer_(viewer), options_(std::move(options)), answer_(answer) {
    thread_ = std::thread([this, request] {
      run(request);
      has_ended_ = true;
    });
  }
  ~Seat() {
    stop_ = true;
    thread_.join();
  }
  Seat(const Seat&) = delete;
  Seat& operator=(const Seat&) = delete;

  /// False when too many wait.
  bool add(std::uint32_t id, command::ParsedCommand command) {
    const std::scoped_lock lock(mutex_);
    if (waiting_.size() >= kMaxWaiting) return false;
    waiting_.emplace_back(id, std::move(command));
    return true;
  }
  void stop() { stop_ = true; }
  [[nodiscard]] bool hasEnded() const { return has_ended_; }

 private:
  using Waiting = std::pair<std::uint32_t, command::ParsedCommand>;

  void run(std::uint32_t request) {
    const std::string role(roleName(options_.role));
    auto client = command::CommandClient::open(options_, stop_);
    if (!client) return answer_(viewer_, {request, false, client.error().what, {}});
    answer_(viewer_, {request, true, {}, role});
    while (!stop_) {
      (*client)->dispatch(kCollect);
      while (auto waiting = take()) {
        const auto done = (*client)->send(waiting->second, stop_);
        if (stop_) return;
        answer_(viewer_, {waiting->first, done.has_value(), done ? "" : done.error().what, role});
      }
      if (const auto& lost = (*client)->lost()) return answer_(viewer_, {0, false, *lost, {}});
    }
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
  std::atomic<bool> stop_{false};
  std::atomic<bool> has_ended_{false};
  std::thread thread_;
};

/// Raises the emergency stop; needs neither seat nor server. Those that arrive while one is raised are
/// answered with it.
class Desk::Stopper {
 public:
  Stopper(std::uint32_t domain, const Answer& answer) : domain_(domain), answer_(answer) {
    thread_ = std::thread([this] { run(); });
  }
  ~Stopper() {
    {
      const std::scoped_lock lock(mutex_);
      stop_ = true;
    }
    changed_.notify_one();
    thread_.join();
  }
  Stopper(const Stopper&) = delete;
  Stopper& operator=(const Stopper&) = delete;

  struct Raise {
    ViewerId viewer = 0;  ///< 0: nothing is raised, all is made ready
    std::uint32_t id = 0;
    std::string session;
    std::string reason;
  };
  void add(Raise raise) {
    {
      const std::scoped_lock lock(mutex_);
      const auto same = std::count_if(raises_.begin(), raises_.end(),
                                      [&](const Raise& other) { return other.viewer == raise.viewer; });
      if (same >= static_cast<std::ptrdiff_t>(kMaxWaiting)) return;
      raises_.push_back(std::move(raise));
    }
    changed_.notify_one();
  }

 private:
  void run() {
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [this] { return stop_ || !raises_.empty(); });
      if (stop_) return;
      const Raise first = std::move(raises_.front());
      raises_.pop_front();
      lock.unlock();
      const DeskAnswer outcome = raise(first);
      lock.lock();
      if (first.viewer == 0) continue;
      answerAll(first, outcome);
    }
  }
  /// With the mutex held.
  void answerAll(const Raise& first, DeskAnswer outcome) {
    answer_(first.viewer, outcome);
    std::erase_if(raises_, [&](const Raise& raise) {
      if (raise.viewer == 0 || raise.session != first.session) return false;
      outcome.id = raise.id;
      answer_(raise.viewer, outcome);
      return true;
    });
  }
  DeskAnswer raise(const Raise& raise) {
    DeskAnswer answer{.id = raise.id};
    auto& raiser = raisers_[raise.session];
    if (raiser == nullptr) {
      auto opened = command::StopRaiser::open(domain_, raise.session, "console");
      if (!opened) {
        raisers_.erase(raise.session);
        answer.text = opened.error().what;
        return answer;
      }
      raiser = std::move(*opened);
    }
    if (raise.viewer == 0) return answer;
    const auto heard = raiser->raise(raise.reason, kForAServer, stop_);
    const auto outcome =
        heard ? command::outcomeOf(*heard, domain_, raise.session) : fail(heard.error().what);
    answer.accepted = outcome.has_value();
    answer.text = outcome ? (heard->by_server ? "" : *outcome) : outcome.error().what;
    return answer;
  }

  std::uint32_t domain_;
  const Answer& answer_;
  std::map<std::string, std::unique_ptr<command::StopRaiser>> raisers_;  ///< by session
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Raise> raises_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

Desk::Desk(SeatRights rights, Answer answer)
    : rights_(std::move(rights)),
      answer_(std::move(answer)),
      stopper_(std::make_unique<Stopper>(rights_.domain, answer_)) {}

Desk::~Desk() = default;

void Desk::expect(const std::string& session) { stopper_->add({.session = session}); }

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
  auto parsed = command::parseCommand(request.words);
  if (!parsed) {
    answer.text = parsed.error().what;
    return answer_(viewer, answer);
  }
  if (!parsed->command) {
    const std::string reason = parsed->text.empty() ? "requested" : parsed->text.substr(0, 255);
    return stopper_->add({viewer, request.id, session, reason});
  }
  const std::scoped_lock lock(mutex_);
  const auto seat = seats_.find(viewer);
  if (seat == seats_.end() || seat->second->hasEnded()) {
    answer.text = "an observer gives no commands: sit down as instructor first";
    return answer_(viewer, answer);
  }
  if (!seat->second->add(request.id, std::move(*parsed))) {
    answer.text = "too many commands wait for the server";
    answer_(viewer, answer);
  }
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
  if (seats_.size() >= kMaxSeats) return refuse("all seats of this gateway are taken");
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
