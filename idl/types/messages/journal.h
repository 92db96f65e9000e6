#pragma once

#include <cstdint>
#include <vector>

#include "idl/types/ids.h"

/// The journal of a session: what is needed to simulate it again.
namespace tenon {

/// Part of the inputs of one tick in their journal form (server/session/tick_io.h).
struct TickInputPart {
  Tick tick = 0;
  std::uint32_t part = 0;
  std::uint32_t parts = 1;
  std::uint64_t state_hash = 0;  ///< after the tick
  std::vector<std::uint8_t> bytes;
};

/// Part of a checkpoint: the whole changing state of the session after a tick.
struct CheckpointPart {
  Tick tick = 0;
  std::uint32_t part = 0;
  std::uint32_t parts = 1;
  std::uint64_t state_hash = 0;  ///< after the tick
  std::vector<std::uint8_t> bytes;
};

}  // namespace tenon
