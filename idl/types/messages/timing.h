#pragma once

#include <cstdint>

#include "idl/types/ids.h"

/// Work and timing of the server and the stations.
namespace tenon {

/// Work and timing of the server. Maxima are over the ticks since the last sample.
struct TickStats {
  std::uint32_t server_epoch = 0;
  Tick tick = 0;
  double load_percent = 0.0;         ///< [%] maximum over the active pairs
  double compute_seconds = 0.0;      ///< [s] of this tick
  double compute_seconds_max = 0.0;  ///< [s] maximum
  std::uint64_t late_ticks = 0;      ///< since the start of the server
  std::uint32_t active_pairs = 0;    ///< maximum
  std::uint32_t queried_pairs = 0;   ///< maximum
  std::uint64_t points_visited = 0;  ///< maximum
  double input_age_seconds = 0.0;    ///< [s] of the oldest device sample in use, maximum
  std::uint64_t state_hash = 0;      ///< after this tick
};

/// Time stamps of a request to the server and of its answer, each by the monotonic clock of the program that
/// set it.
struct ClockSync {
  ClientId client;
  std::int64_t sent_ns = 0;             ///< [ns] by the client
  std::int64_t server_received_ns = 0;  ///< [ns] by the server
  std::int64_t server_sent_ns = 0;      ///< [ns] by the server; 0: a request
};

/// Timing of a station since its start: percentiles and maximum of the time from a device sample to the use
/// of the manifold that answers it, and lateness of the haptic loop.
struct Telemetry {
  ClientId client;
  double input_to_force_p50 = 0.0;  ///< [s]
  double input_to_force_p99 = 0.0;  ///< [s]
  double input_to_force_max = 0.0;  ///< [s]
  double loop_late_p99 = 0.0;       ///< [s]
  std::uint64_t loop_overruns = 0;
  std::uint64_t samples = 0;
};

}  // namespace tenon
