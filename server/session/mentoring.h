#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/role.h"
#include "idl/types/messages/steps.h"
#include "idl/types/result.h"
#include "server/game_control/scenario.h"
#include "server/session/refused.h"
#include "server/session/tick_io.h"

namespace tenon::session {

/// Guidance of trainees' hands by instructors' hands: what was chosen, and the fixtures that follow from it.
///
/// A hand is guided by one other hand at a time. What was chosen stands until it is ended, somebody else has
/// one of the two hands, an emergency stop is engaged or the run is over; then it has to be chosen again.
/// While a hand is held still, is not heard or holds nothing, its fixture is off and returns.
///
/// A fixture is no part of the simulation: a re-simulated journal needs none, since it has the motion of the
/// hands, and a resumed server has none.
///
/// Threads: one (wire). Real-time: no.
class Mentoring {
 public:
  static constexpr double kStiffness = 200.0;        ///< [N/m] of a hand that is led
  static constexpr double kMutualStiffness = 100.0;  ///< [N/m] of two hands that are tied to each other
  /// [Ns/m] of two hands that are tied to each other: stiffness times the round trip from one to the other,
  /// at most. Two relaxed arms with 0.1 s and 10 Ns/m swing by 4 mm at 3 Hz [measured].
  static constexpr double kMutualDamping = 3.0;
  static constexpr double kUnknownRoundTrip = 0.1;     ///< [s] of a station that has not said it yet
  static constexpr double kDamping = 2.0;              ///< [Ns/m]
  static constexpr double kRotationalStiffness = 0.5;  ///< [Nm/rad] of a hand that is led to a pose
  static constexpr double kTubeRadius = 0.01;          ///< [m]
  static constexpr Tick kPeriod = 5;                   ///< [ticks] between messages
  static constexpr std::size_t kMostPlaces = 24'000;   ///< of a recorded path: two minutes
  static constexpr double kLeash = 0.03;  ///< [m] a recorded path waits for a hand that is farther behind
  static constexpr std::uint32_t kSilent = 50;  ///< [ticks] age of a hand's input: its fixture is off

  /// `scenario` must outlive this.
  Mentoring(const game_control::ScenarioFile& scenario, std::uint32_t server_epoch)
      : scenario_(scenario), server_epoch_(server_epoch) {}

  /// Of the link of `client`: `round_trip` [s] from its station to the server and back, with its jitter.
  void setRoundTrip(ClientId client, double round_trip);
  /// Whoever moved hands as `client` has left: what it had a part in ends, also if another program comes back
  /// as it.
  void left(ClientId client);
  /// Decides a command of `client`, which has `role`; `controllers` of each hand. For the words see
  /// mentoringUsage().
  [[nodiscard]] tl::expected<void, Refused> decide(std::string_view words, ClientId client, Role role,
                                                   std::span<const ClientId> controllers);
  /// The fixtures of a tick, every kPeriod ticks; `ended` gets a sentence for what has ended by itself.
  [[nodiscard]] std::vector<Guidance> step(const TickOutput& output, std::span<const ClientId> controllers,
                                           std::vector<std::string>& ended);

 private:
  struct Choice {
    std::uint32_t number = 0;
    HandId hand, guide;
    ClientId hand_client, guide_client;
    GuidanceMode mode = GuidanceMode::kLead;
    double stiffness = kStiffness;  ///< [N/m]
    FixtureKind kind = FixtureKind::kPose;
    bool turns = false;         ///< the hand is turned as the guide
    bool follows_path = false;  ///< the recorded one of the guide
    std::size_t place = 0;      ///< of that path: where the fixture is
    bool mutual = false;        ///< the guide is led to the hand, too
    bool is_left = false;       ///< by whoever moved one of the hands
  };
  /// Where a guide's hand was seen, every kPeriod ticks.
  struct Path {
    HandId guide;
    ClientId client;
    std::vector<Pose> X_WF;
    bool records = false;
  };
  /// What has ended is said to be off for a while, so that its force falls at once.
  struct Ended {
    HandId hand;
    Tick until = 0;
  };

  [[nodiscard]] tl::expected<Choice, Refused> parse(std::string_view words, ClientId client,
                                                    std::span<const ClientId> controllers) const;
  /// `otherwise` names one of several hands in the command, as in "by {}".
  [[nodiscard]] tl::expected<HandId, Refused> guideOf(std::string_view name, std::string_view otherwise,
                                                      ClientId client,
                                                      std::span<const ClientId> controllers) const;
  [[nodiscard]] tl::expected<void, Refused> record(std::string_view words, ClientId client,
                                                   std::span<const ClientId> controllers);
  [[nodiscard]] double roundTripOf(ClientId client) const;
  [[nodiscard]] Path* pathOf(HandId guide);
  void updatePaths(const TickOutput& output, std::span<const ClientId> controllers);
  [[nodiscard]] tl::expected<void, Refused> conflict(const Choice& choice) const;
  [[nodiscard]] tl::expected<void, Refused> end(std::string_view words, Role role);
  [[nodiscard]] std::string whyEnded(const Choice& choice, const TickOutput& output,
                                     std::span<const ClientId> controllers) const;
  [[nodiscard]] double mutualStiffness(const Choice& choice) const;
  [[nodiscard]] Guidance fixtureOf(Choice& choice, const TickOutput& output);
  /// Names of those that display forces.
  [[nodiscard]] std::vector<std::string> handsOf(Role role) const;
  [[nodiscard]] const std::string& nameOf(HandId hand) const { return scenario_.hands[hand.value].name; }
  void erase(std::size_t index);

  const game_control::ScenarioFile& scenario_;
  std::uint32_t server_epoch_;
  std::uint32_t numbers_ = 0;
  std::vector<Choice> choices_;
  std::map<ClientId, double> round_trips_;  ///< [s]
  std::vector<Path> paths_;                 ///< the last one of each guide
  std::vector<HandId> ended_since_tick_;
  std::vector<Ended> ended_;
  StepState step_;  ///< current
};

/// How the command is written.
[[nodiscard]] std::string_view mentoringUsage() noexcept;

}  // namespace tenon::session
