#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "idl/types/messages.h"
#include "server/game_control/scenario.h"
#include "server/session/tick_io.h"

namespace tenon {

/// Who is here, what each may do, who moves which hand. Knows neither network nor time: it is told what
/// arrived and says what follows, as Changes for the next tick and as answers to the sender.
///
/// Threads: one (wire).
class FrontDesk {
 public:
  FrontDesk(const ScenarioFile& scenario, std::uint32_t server_epoch, bool lockstep, std::uint64_t seed);

  [[nodiscard]] Welcome join(const Join& join, Tick now);
  [[nodiscard]] CommandAck command(const Command& command);
  void leave(ClientId client);
  void emergencyStop(const EmergencyStop& stop);

  /// Takes a reading over into the next tick if this client may move this hand and the numbers make sense.
  /// Otherwise says why not, as a sentence for the event log.
  [[nodiscard]] Result<HandReading> reading(const DeviceInput& input) const;
  [[nodiscard]] Result<Change> contribution(const ForceContribution& force) const;
  [[nodiscard]] Result<Change> externalPose(const ExternalPose& pose) const;

  /// What has been decided since the last call, at most as many as a tick can take over.
  void takeChanges(FixedVector<Change, kMaxChanges>& out);

  [[nodiscard]] const std::vector<Presence>& people() const { return people_; }
  [[nodiscard]] const Presence* person(ClientId client) const;
  /// The random name a client asked with.
  [[nodiscard]] const std::string& guidOf(ClientId client) const { return seats_[client.value - 1].guid; }
  [[nodiscard]] ClientId moverOf(HandId hand) const { return movers_[hand.value]; }
  [[nodiscard]] bool roleIsHere(Role role) const;
  [[nodiscard]] std::vector<std::string> freeHands() const;

 private:
  struct Seat {
    std::string guid;
    std::string token;
    Welcome welcome;
  };

  [[nodiscard]] std::string refusal(const Join& join) const;
  void seat(const Join& join, Welcome& welcome);
  [[nodiscard]] Result<Change> changeFor(const Command& command, Role role) const;
  [[nodiscard]] int pairNamed(std::string_view a, std::string_view b) const;
  [[nodiscard]] bool movesBothHands(ClientId client) const;
  [[nodiscard]] bool isMover(ClientId client, HandId hand) const;

  const ScenarioFile& scenario_;
  std::uint32_t server_epoch_;
  bool lockstep_;
  std::mt19937_64 random_;
  std::vector<Presence> people_;  ///< in order of joining; those who left stay with alive = false
  std::vector<Seat> seats_;       ///< as people_
  std::vector<ClientId> movers_;  ///< index = HandId
  std::vector<Change> changes_;
};

[[nodiscard]] std::string_view roleName(Role role);

}  // namespace tenon
