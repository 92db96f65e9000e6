#include "clients/console/browser_hands.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "clients/haptic/station_program.h"
#include "clients/station/device_station.h"
#include "devices/drivers/browser_device.h"
#include "idl/types/names.h"

namespace tenon::console {

namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;
constexpr milliseconds kShowPeriod{16};
constexpr milliseconds kAskAgain{300};  // for a hand that somebody else moves
constexpr std::chrono::seconds kAskFor{6};
constexpr std::chrono::seconds kNoView{10};  // from the seat on, without which the session has no such hands
constexpr const char* kTaken = "is already moved by somebody else";

}  // namespace

/// One person's station.
class BrowserHands::Seat {
 public:
  Seat(ViewerId viewer, wire::MembershipOptions membership, const DeskRequest& request, const Answer& answer,
       const Print& print)
      : viewer_(viewer),
        membership_(std::move(membership)),
        request_(request),
        answer_(answer),
        print_(print) {
    for (std::size_t i = 0; i < request.hands.size(); ++i)
      devices_.push_back(std::make_shared<devices::BrowserDevice>());
    views_.resize(devices_.size());
    thread_ = std::thread([this] {
      run();
      has_ended_ = true;
    });
  }
  ~Seat() {
    stop_ = true;
    thread_.join();
  }
  Seat(const Seat&) = delete;
  Seat& operator=(const Seat&) = delete;

  void stop() { stop_ = true; }
  [[nodiscard]] bool hasEnded() const { return has_ended_; }

  [[nodiscard]] bool move(std::span<const std::uint8_t> bytes) {
    if (bytes.size() != devices_.size() * devices::kRemoteTargetSize) return false;
    std::vector<devices::RemoteTarget> targets;
    for (std::size_t i = 0; i < devices_.size(); ++i) {
      const auto target =
          devices::decodeTarget(bytes.subspan(i * devices::kRemoteTargetSize, devices::kRemoteTargetSize));
      if (!target) return false;
      targets.push_back(*target);
    }
    for (std::size_t i = 0; i < devices_.size(); ++i) devices_[i]->move(targets[i]);
    return true;
  }

  /// Null when there is nothing new. Answers the request with the first one, and ends what is silent.
  [[nodiscard]] Payload takeViews() {
    bool is_new = false, is_whole = true;
    for (std::size_t i = 0; i < devices_.size(); ++i) {
      devices::RemoteView view;
      if (devices_[i]->takeView(view)) views_[i] = view, is_new = true;
      is_whole = is_whole && views_[i].has_value();
      if (devices_[i]->isGone()) giveUp("nothing was heard of this page for 10 s");
    }
    if (!is_shown_ && steady_clock::now() > shown_until_.load()) giveUp("the session has no such hand");
    if (!is_new || !is_whole || stop_ || has_ended_) return nullptr;
    if (!is_shown_.exchange(true))
      answer_(viewer_, {request_.id, true, {}, std::string(roleName(membership_.role)), true});
    auto bytes = std::make_shared<std::vector<std::uint8_t>>();
    for (const auto& view : views_) {
      const auto encoded = devices::encodeView(*view);
      bytes->insert(bytes->end(), encoded.begin(), encoded.end());
    }
    return bytes;
  }

 private:
  void giveUp(const char* why) {
    if (!stop_) why_ = why;
    stop_ = true;
  }

  void run() {
    const auto begun = steady_clock::now();
    Result<RunState> ended = play();
    // who is asked to make room needs a moment
    if (!ended && ended.error().what.find(kTaken) != std::string::npos) {
      for (const std::string& hand : request_.hands) print_("hand '" + hand + "' is asked for by a browser");
      while (!stop_ && !ended && ended.error().what.find(kTaken) != std::string::npos &&
             steady_clock::now() - begun < kAskFor) {
        std::this_thread::sleep_for(kAskAgain);
        ended = play();
      }
    }
    const char* const why = why_;
    if (stop_ && why == nullptr) return;
    const std::string text = why != nullptr ? why : ended ? ended->reason : ended.error().what;
    answer_(viewer_, {is_shown_.exchange(true) ? 0 : request_.id, false, text, {}, true});
  }

  Result<RunState> play() {
    station::StationOptions options;
    options.role = membership_.role;
    options.hands = request_.hands;
    options.kind = station::PersonKind::kNone;
    for (const auto& device : devices_) options.devices.push_back({"browser", {}, device});
    auto station = station::DeviceStation::open(options);
    if (!station) return fail(station.error().what);
    haptic::StationProgramOptions program;
    program.membership = membership_;
    program.real_time = false;  // the memory of a gateway is not locked for one of its viewers
    program.seated = [this] { shown_until_ = steady_clock::now() + kNoView; };
    return haptic::runStation(**station, program, stop_);
  }

  ViewerId viewer_;
  wire::MembershipOptions membership_;
  DeskRequest request_;
  const Answer& answer_;
  const Print& print_;
  std::vector<std::shared_ptr<devices::BrowserDevice>> devices_;
  std::vector<std::optional<devices::RemoteView>> views_;  ///< the newest of each device
  /// When the first views have to be there; never as long as there is no seat, which is asked for in bounds.
  std::atomic<steady_clock::time_point> shown_until_{steady_clock::time_point::max()};
  std::atomic<bool> is_shown_{false};
  std::atomic<const char*> why_{nullptr};  ///< of an end that is not the person's
  std::atomic<bool> stop_{false};
  std::atomic<bool> has_ended_{false};
  std::thread thread_;
};

BrowserHands::BrowserHands(SeatRights rights, Answer answer, Show show, Print print)
    : rights_(std::move(rights)),
      answer_(std::move(answer)),
      show_(std::move(show)),
      print_(std::move(print)),
      thread_([this] { showViews(); }) {}

BrowserHands::~BrowserHands() {
  stop_ = true;
  thread_.join();
}

void BrowserHands::handle(ViewerId viewer, const std::string& session, const DeskRequest& request) {
  if (request.kind == DeskRequest::Kind::kTakePart) return take(viewer, session, request);
  leave(viewer);
  answer_(viewer, {request.id, true, {}, {}, true});
}

void BrowserHands::take(ViewerId viewer, const std::string& session, const DeskRequest& request) {
  const auto refuse = [&](std::string why) {
    answer_(viewer, {request.id, false, std::move(why), {}, true});
  };
  auto membership = membershipOf(rights_, session, request);
  if (!membership) return refuse(std::move(membership.error().what));
  leave(viewer);
  const std::scoped_lock lock(mutex_);
  std::erase_if(seats_, [](const auto& seat) { return seat.second->hasEnded(); });
  if (seats_.size() + left_.size() >= kMaxSeats)
    return refuse("all " + std::to_string(kMaxSeats) + " places of this gateway are taken");
  seats_.emplace(viewer, std::make_unique<Seat>(viewer, std::move(*membership), request, answer_, print_));
}

bool BrowserHands::move(ViewerId viewer, std::span<const std::uint8_t> targets) {
  const std::scoped_lock lock(mutex_);
  const auto seat = seats_.find(viewer);
  return seat != seats_.end() && seat->second->move(targets);
}

void BrowserHands::left(ViewerId viewer) { leave(viewer); }

void BrowserHands::leave(ViewerId viewer) {
  const std::scoped_lock lock(mutex_);
  const auto seat = seats_.find(viewer);
  if (seat == seats_.end()) return;
  seat->second->stop();
  left_.push_back(std::move(seat->second));
  seats_.erase(seat);
}

void BrowserHands::showViews() {
  while (!stop_) {
    std::this_thread::sleep_for(kShowPeriod);
    const std::scoped_lock lock(mutex_);
    std::erase_if(left_, [](const std::unique_ptr<Seat>& seat) { return seat->hasEnded(); });
    for (auto& [viewer, seat] : seats_)
      if (Payload views = seat->takeViews()) show_(viewer, std::move(views));
  }
}

}  // namespace tenon::console
