#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "clients/command/stop_raiser.h"
#include "clients/console/web_options.h"

namespace tenon::console {

/// Raises the emergency stop of one session for people at browsers, who need neither seat nor server.
///
/// A press is written at once, whatever is still awaited of the one before: that may have been cleared by
/// now. Presses within kBetween of one another are one raise. Those that wait when this ends are raised, too.
///
/// Threads: any; one of its own, which alone uses DDS and calls `answer`. Real-time: no.
class Stopper {
 public:
  using Answer = std::function<void(ViewerId, const DeskAnswer&)>;
  static constexpr std::size_t kMaxWaiting = 32;  ///< presses of a viewer that are not answered yet
  static constexpr std::chrono::milliseconds kBetween{100};

  /// `session` empty: all sessions of the DDS domain. `answer` must outlive this.
  Stopper(std::uint32_t domain, std::string session, const Answer& answer);
  ~Stopper();
  Stopper(const Stopper&) = delete;
  Stopper& operator=(const Stopper&) = delete;

  /// False when too many of this viewer wait; `id` is that of the request, for its answer.
  [[nodiscard]] bool add(ViewerId viewer, std::uint32_t id, std::string reason);
  /// The thread ends; does not wait for it.
  void stop();
  /// Nobody waits for an answer, and what was raised is confirmed.
  [[nodiscard]] bool isIdle() const { return !is_busy_; }

 private:
  struct Press {
    ViewerId viewer = 0;
    std::uint32_t id = 0;
    std::string reason;
  };
  struct Raise {
    std::uint32_t number = 0;  ///< of the StopRaiser
    std::vector<Press> presses;
  };

  void run();
  Result<void> open();
  bool awaitWork();
  void raiseWaiting();
  void tell(std::chrono::milliseconds patience);
  [[nodiscard]] DeskAnswer answerOf(const command::StopHeard& heard) const;
  void refuse(const std::vector<Press>& presses, const std::string& why);
  void answered(const std::vector<Press>& presses, DeskAnswer answer);

  const std::uint32_t domain_;
  const std::string session_;
  const Answer& answer_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Press> waiting_;                  ///< to be raised
  std::map<ViewerId, std::size_t> unanswered_;  ///< presses that are not answered yet
  std::atomic<bool> is_busy_{false};
  std::atomic<bool> stop_{false};
  // of the thread
  std::unique_ptr<command::StopRaiser> raiser_;
  std::vector<Raise> raised_;                   ///< their presses wait for the answer
  std::uint32_t unheard_ = 0;                   ///< the newest raise, until a server has heard it; 0: none
  std::chrono::steady_clock::time_point next_;  ///< when it may be raised again
  std::thread thread_;
};

}  // namespace tenon::console
