#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "clients/report/recording_reader.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/steps.h"
#include "idl/types/result.h"

namespace tenon::report {

/// Metrics of a part of a session. Forces are those that the devices displayed on the trainee's hands. Not a
/// number: samples that the metric rests on are missing.
struct SessionMetrics {
  double peak_force = 0.0;       ///< [N]
  double mean_force = 0.0;       ///< [N] over the time in which the hand's object was in contact
  double contact_seconds = 0.0;  ///< [s]
  double gap = 0.0;              ///< [m] largest distance between device and proxy
  double depth = 0.0;            ///< [m] largest penetration depth of a pair
  double load = 0.0;             ///< [%] largest of a pair (paper eq. 2)
};

/// One visit of a step: from its begin to its end, or to the begin of the next one.
struct StepVisit {
  std::uint32_t step = 0;
  std::uint32_t revision = 0;  ///< of the StepState that began it
  std::string name;
  std::string title;
  std::string part;
  ObjectId object;
  StepPhase phase = StepPhase::kActive;
  bool is_end_known = true;  ///< false: neither a message nor the log of events says how it ended
  double begin = 0.0;        ///< [s]
  double end = 0.0;          ///< [s]
  double seconds = 0.0;      ///< [s] of the step's own time, without pauses and stops: StepClock
  SessionMetrics metrics;
  std::uint32_t attempt = 1;          ///< of this step, counted from 1: a step can be repeated
  double path = 0.0;                  ///< [m] that the step's object was moved; not a number: as of metrics
  std::optional<int> collisions = 0;  ///< contacts of the step's object that began, after 0.2 s without one
  bool has_target = false;
  TargetError error;      ///< last measured; not a number: as of metrics
  TargetError tolerance;  ///< of the target
};

/// Analysis of a recorded session for the trainer: steps, events, forces, and real-time performance.
///
/// Threads: one at a time. Real-time: no.
struct SessionAnalysis {
  std::string file;
  std::string problem;  ///< why the file is incomplete, and what samples it lacks; empty: it is complete
  std::map<std::string, SampleCount> missing;  ///< by topic, of those of which samples are missing
  std::string session;
  std::string title;
  std::int64_t began_ns = 0;  ///< [ns] since 1970
  bool lockstep = false;
  std::vector<SessionParticipant> participants;
  RunState run;
  bool has_run = false;
  std::uint32_t steps = 0;  ///< of the exercise
  std::vector<StepVisit> visits;
  std::vector<SessionEvent> events;
  std::vector<std::string> aids;  ///< help the trainee had, one phrase each
  std::vector<ForceLatency> force_latencies;

  Series trainee_force;     ///< [N] the larger of the two hands
  Series instructor_force;  ///< [N]
  Series gap;               ///< [m] between device and proxy, trainee's hands
  Series depth;             ///< [m] largest penetration depth
  Series load;              ///< [%]
  Series compute;           ///< [s] of one tick, sampled at 100 Hz
  Series compute_max;       ///< [s] largest since the previous sample

  double duration = 0.0;  ///< [s]
  SessionMetrics whole;
  double path = 0.0;                                                    ///< [m] of all steps
  std::optional<int> collisions = 0;                                    ///< of all steps
  double compute_median = 0.0, compute_p99 = 0.0, compute_worst = 0.0;  ///< [s]
  std::uint64_t late_ticks = 0;
  std::uint64_t slow_writes = 0;     ///< of the server to the bus, of more than 5 ms
  std::uint64_t unsent_samples = 0;  ///< that the bus did not take
  double input_age = 0.0;            ///< [s] age of the oldest input that a tick used
  std::uint64_t messages = 0;
  std::uint64_t malformed = 0;  ///< messages that could not be decoded

  /// The run succeeded, and every step was done (`allow_skips`: or skipped) in the recording.
  [[nodiscard]] bool succeeded(bool allow_skips = false) const;
};

/// Analyses a recording; titles in `language`, or in the first language there is. Of a truncated recording
/// the part that can be read is analysed and `problem` says so; fails with a sentence when the file holds no
/// message.
[[nodiscard]] Result<SessionAnalysis> analyzeRecording(const std::filesystem::path& file,
                                                       const std::string& language = "en");

}  // namespace tenon::report
