#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/tell/words.h"
#include "idl/types/result.h"
#include "idl/wire/membership.h"

namespace tenon {

/// A seat in a session from which commands are given.
///
/// Threads: one. Real-time: no.
class Teller {
 public:
  using Stop = Membership::Stop;

  static Result<std::unique_ptr<Teller>> open(MembershipWishes wishes, const Stop& stop);

  /// Says it and waits for the answer. Fails with the server's reason, or when none answers.
  [[nodiscard]] Result<void> tell(const Saying& saying, const Stop& stop);
  /// Hears what there is, for `timeout`; false when the session is over or gone.
  bool listen(std::chrono::milliseconds timeout);

  /// What happens meanwhile, as a person wants to follow it.
  std::function<void(const std::string&)> say;

 private:
  explicit Teller(MembershipWishes wishes) : wishes_(std::move(wishes)) {}
  Result<void> begin(const Stop& stop);
  Result<void> stopEverything(const Saying& saying, const Stop& stop);
  void hear(const RunState& run);

  MembershipWishes wishes_;
  std::unique_ptr<Membership> member_;
  std::unique_ptr<Writer<Command>> commands_;
  std::unique_ptr<Writer<EmergencyStop>> stops_;
  std::uint32_t said_ = 0;
  std::optional<CommandAck> ack_;
  bool stopped_ = false;  ///< an emergency stop is engaged, as the server says
  std::string step_;
  RunState run_;
  Inbox inbox_;
};

/// Tells one thing; 0 when it was accepted.
[[nodiscard]] int tellOnce(Teller& teller, const std::vector<std::string>& said,
                           const std::atomic<bool>& stop);
/// A key is a command, until `q`, the end of the input or of the session.
[[nodiscard]] int tellByKeys(Teller& teller, const std::vector<std::string>& signals,
                             const std::atomic<bool>& stop);

}  // namespace tenon
