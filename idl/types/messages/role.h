#pragma once

#include <cstdint>

namespace tenon {

enum class Role : std::uint32_t { kAdmin, kInstructor, kTrainee, kObserver, kRecorder };

}  // namespace tenon
