#pragma once

#include <memory>

#include "clients/haptic/mover.h"
#include "clients/simulated_person/person.h"

namespace tenon::simulated_person {

/// The simulated trainee as the mover of a station: of the hand named `left`, and of the first other one as
/// its right hand. Threads: any. Real-time: no.
[[nodiscard]] std::unique_ptr<haptic::Mover> makeTrainee(const PersonOptions& person);

/// Likewise the simulated instructor, of the station's first hand.
[[nodiscard]] std::unique_ptr<haptic::Mover> makeInstructor(const PersonOptions& person);

}  // namespace tenon::simulated_person
