#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "clients/haptic/rate_chooser.h"
#include "clients/haptic/station.h"
#include "idl/types/messages/hands.h"

namespace tenon::haptic {

/// Which inputs of a station are sent, and with what.
///
/// Threads: one. Real-time: everything.
class InputPacer {
 public:
  /// Input `index` of the station as it is sent in cycle `seq`; none: it is not due. `earlier` samples may be
  /// lost before it, and come along (LinkChoice::playout_ticks); sparse inputs carry none.
  [[nodiscard]] std::optional<DeviceInput> due(const DeviceInput& input, std::size_t index, std::uint32_t seq,
                                               const RateChooser& rates, std::uint32_t earlier) noexcept {
    const std::uint8_t period = rates.inputPeriod(input.period);
    if (period > 1 && seq - sent_[index] < period) return std::nullopt;
    sent_[index] = seq;
    DeviceInput sent = input;
    sent.period = period;
    sent.earlier.resize(std::min<std::size_t>(sent.earlier.size(), period > 1 ? 0 : earlier));
    return sent;
  }

 private:
  std::array<std::uint32_t, kMaxStationHands> sent_{};  // seq of the last one, by index
};

}  // namespace tenon::haptic
