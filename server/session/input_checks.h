#pragma once

#include <vector>

#include "idl/types/messages/external.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/session.h"
#include "idl/types/result.h"
#include "server/game_control/scenario.h"
#include "server/session/tick_io.h"

/// What a client sends is judged before it reaches the simulation: numbers that are not finite or that no
/// device and no scene has would end in the solver of everybody.
///
/// Threads: any. Real-time: no.
namespace tenon::session {

/// The newest sample of `input`, of the hand's controller, as tick input. Fails, with a sentence for the
/// event log, when the numbers are implausible (not finite, beyond 1 km, 50 m/s or 50 rad/s, no unit
/// quaternion).
[[nodiscard]] Result<HandReading> checkedReading(const DeviceInput& input, const std::string& hand);
/// Why these stiffnesses are no device's; empty: they are plausible or not stated.
[[nodiscard]] std::string stiffnessRefusal(const std::vector<HandStiffness>& stiffness);
/// Fails for unknown objects and wrenches that are not finite. Those that are too large or last too long are
/// passed on as they are: ForceBuffer::contribute clamps them.
[[nodiscard]] Result<Change> checkedForce(const ForceContribution& force,
                                          const game_control::ScenarioFile& scenario);
/// Fails for unknown objects and implausible poses.
[[nodiscard]] Result<Change> checkedPose(const ExternalPose& pose,
                                         const game_control::ScenarioFile& scenario);

}  // namespace tenon::session
