#pragma once

#include <cstdint>

#include "idl/types/ids.h"
#include "idl/types/messages/hands.h"

/// Work and timing of the server and the stations.
namespace tenon {

/// [s] One way: over a link with a longer delay contacts are not felt, virtual fixtures alone.
inline constexpr double kLongestContactDelay = 0.15;

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
  std::uint64_t slow_writes = 0;     ///< to the bus, of more than 5 ms, since the start of the server
  std::uint64_t unsent_samples = 0;  ///< that the bus did not take, since the start of the server
};

/// Time stamps of a request to the server and of its answer, each by the monotonic clock of the program that
/// set it.
struct ClockSync {
  ClientId client;
  std::int64_t sent_ns = 0;             ///< [ns] by the client
  std::int64_t server_received_ns = 0;  ///< [ns] by the server
  std::int64_t server_sent_ns = 0;      ///< [ns] by the server; 0: a request
  std::uint32_t inputs_received = 0;    ///< DeviceInput messages of this client that the server has received
  std::uint32_t inputs_replaced = 0;    ///< samples that a newer one replaced before a tick took them
  std::uint32_t ticks_without_input = 0;  ///< of the client's hands, which had nothing new
  std::uint32_t newest_seq = 0;           ///< largest DeviceSample::seq among them
  double longest_gap = 0.0;  ///< [s] longest time between two inputs of this client, of the last 1 to 2 s
};

/// Timing of a station: since its start, percentiles and maximum of the time from a device sample to the use
/// of the manifold that answers it, and lateness of the haptic loop; since the last sample, what its link
/// does now; and what its clock is against the server's.
struct Telemetry {
  ClientId client;
  double input_to_force_p50 = 0.0;   ///< [s]
  double input_to_force_p99 = 0.0;   ///< [s]
  double input_to_force_max = 0.0;   ///< [s]
  double inputs_replaced = 0.0;      ///< [-] share that a newer one replaced at the server, as inputs_lost
  double ticks_without_input = 0.0;  ///< [-] share of the server's ticks for its hands, as inputs_lost
  double input_gap = 0.0;            ///< [s] ClockSync::longest_gap
  double trip_jitter = 0.0;  ///< [s] 90th percentile of the last round trips of ClockSync less the shortest
  HandLimits limits;         ///< that the station asks the server for, by what its link does
  std::uint32_t playout_ticks = 0;  ///< [ticks] for which the server is to keep its inputs back
  double loop_late_p99 = 0.0;       ///< [s]
  std::uint64_t loop_overruns = 0;
  std::uint64_t samples = 0;
  double age = 0.0;     ///< [s] from device sample to the use of its answer, median since the last Telemetry
  double jitter = 0.0;  ///< [s] likewise, 99th percentile less the minimum
  double answers_lost = 0.0;  ///< [-] share of the server's manifolds that did not arrive, of the last second
                              ///< without an interruption
  double answers_replaced = 0.0;  ///< [-] share that a newer one replaced before a cycle used them, since the
                                  ///< last Telemetry
  double inputs_lost = 0.0;  ///< [-] share of about 2000 of its inputs that did not reach the server, without
                             ///< an interruption among them
  bool guidance_alone = false;   ///< the link is too long for contacts (kLongestContactDelay)
  bool clock_known = false;      ///< the server has answered ClockSync
  double clock_offset = 0.0;     ///< [s] monotonic clock of the server less that of the station
  double clock_error = 0.0;      ///< [s] bound of what clock_offset is off
  double round_trip = 0.0;       ///< [s] shortest of the last exchanges of ClockSync
  double longest_silence = 0.0;  ///< [s] without an answer of the server to a newer input
};

}  // namespace tenon
