#include "clients/console/stopper.h"

#include <utility>

namespace tenon::console {

namespace {

using std::chrono::milliseconds;
constexpr milliseconds kListen{20};
constexpr milliseconds kForAServer{1500};  // to repeat an emergency stop

}  // namespace

Stopper::Stopper(std::uint32_t domain, std::string session, const Answer& answer)
    : domain_(domain), session_(std::move(session)), answer_(answer) {
  thread_ = std::thread([this] { run(); });
}

Stopper::~Stopper() {
  stop();
  thread_.join();
}

bool Stopper::add(ViewerId viewer, std::uint32_t id, std::string reason) {
  const std::scoped_lock lock(mutex_);
  if (unanswered_[viewer] >= kMaxWaiting) return false;
  ++unanswered_[viewer];
  waiting_.push_back({viewer, id, std::move(reason)});
  is_busy_ = true;
  changed_.notify_one();
  return true;
}

void Stopper::stop() {
  const std::scoped_lock lock(mutex_);
  stop_ = true;
  changed_.notify_one();
}

void Stopper::run() {
  static_cast<void>(open());  // before anybody presses; tried again then
  while (awaitWork()) {
    if (std::chrono::steady_clock::now() >= next_) raiseWaiting();
    if (raiser_ != nullptr) raiser_->dispatch(kListen);
    tell(kForAServer);
  }
  raiseWaiting();
  tell(milliseconds(0));
}

Result<void> Stopper::open() {
  if (raiser_ != nullptr) return {};
  auto opened = command::StopRaiser::open(domain_, session_, "console");
  if (!opened) return fail(opened.error().what);
  raiser_ = std::move(*opened);
  return {};
}

/// False when this ends.
bool Stopper::awaitWork() {
  std::unique_lock lock(mutex_);
  is_busy_ = !waiting_.empty() || !raised_.empty() || unheard_ != 0;
  changed_.wait(lock, [this] { return stop_ || is_busy_; });
  return !stop_;
}

/// One raise for all presses that wait.
void Stopper::raiseWaiting() {
  std::vector<Press> presses;
  {
    const std::scoped_lock lock(mutex_);
    presses.swap(waiting_);
  }
  if (presses.empty()) return;
  if (const auto opened = open(); !opened) return refuse(presses, opened.error().what);
  const auto number = raiser_->write(presses.front().reason);
  if (!number) return refuse(presses, number.error().what);
  next_ = std::chrono::steady_clock::now() + kBetween;
  unheard_ = *number;
  raised_.push_back({*number, std::move(presses)});
}

/// Answers those of whose raise it is known who has heard it.
void Stopper::tell(milliseconds patience) {
  std::erase_if(raised_, [&](const Raise& raise) {
    const auto heard = raiser_->heard(raise.number, patience);
    if (!heard) return false;
    answered(raise.presses, answerOf(*heard));
    return true;
  });
  if (unheard_ != 0 && raiser_->heard(unheard_, milliseconds(0))->isConfirmed()) unheard_ = 0;
}

/// What a server has published as standing is confirmed, and nothing else.
DeskAnswer Stopper::answerOf(const command::StopHeard& heard) const {
  if (heard.isConfirmed()) return {.accepted = true};
  const auto outcome = command::outcomeOf(heard, domain_, session_);
  const char* const code = heard.by_server      ? "stop_partly"
                           : heard.stations > 0 ? "stop_devices"
                                                : "stop_unheard";
  return {.text = outcome ? *outcome : outcome.error().what, .code = code};
}

void Stopper::refuse(const std::vector<Press>& presses, const std::string& why) {
  answered(presses, {.text = why});
}

void Stopper::answered(const std::vector<Press>& presses, DeskAnswer answer) {
  const std::scoped_lock lock(mutex_);
  for (const Press& press : presses) {
    answer.id = press.id;
    answer_(press.viewer, answer);
    if (--unanswered_[press.viewer] == 0) unanswered_.erase(press.viewer);
  }
}

}  // namespace tenon::console
