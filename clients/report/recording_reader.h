#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "clients/report/hand_series.h"
#include "clients/report/sample_coverage.h"
#include "clients/report/series.h"
#include "idl/types/messages/log.h"
#include "idl/types/messages/run.h"
#include "idl/types/messages/session.h"
#include "idl/types/messages/steps.h"
#include "idl/types/result.h"
#include "idl/types/step_clock.h"

namespace tenon::report {

/// An entry of the event log, or an event at a station.
struct SessionEvent {
  double time = 0.0;  ///< [s]
  Severity severity = Severity::kInfo;
  std::string kind;
  std::string text;
  int times = 1;  ///< [] that one entry of a station stands for
};

/// A person or program that joined the session.
struct SessionParticipant {
  std::string name;
  Role role = Role::kObserver;
};

/// Latency from an input to the force displayed in answer to it, as measured by one station.
struct ForceLatency {
  std::string who;                         ///< name of the participant
  double p50 = 0.0, p99 = 0.0, max = 0.0;  ///< [s]
  double silence = 0.0;                    ///< [s] longest without an answer of the server
  double jitter = 0.0;                     ///< [s] largest of a second, 99th percentile less the minimum
  double inputs_lost = 0.0, answers_lost = 0.0;          ///< [-] mean shares
  double inputs_replaced = 0.0, answers_replaced = 0.0;  ///< [-] likewise
  double ticks_without_input = 0.0;                      ///< [-] likewise
  double guidance_alone = 0.0;     ///< [-] share of the time in which the link was too long for contacts
  std::uint32_t freeze_ticks = 0;  ///< [ticks] largest HandLimits::freeze_ticks of its hands
  double round_trip = 0.0;         ///< [s] shortest
  double clock_offset = 0.0,
         clock_error = 0.0;  ///< [s] of the server's clock against the station's, at the end
  bool clock_known = false;
  std::uint64_t statements = 0;  ///< Telemetry samples
};

/// Where an object was.
struct PathPoint {
  Tick tick = 0;
  std::uint32_t epoch = 0;  ///< differs after a discontinuous change of the pose
  Eigen::Vector3f p_WO = Eigen::Vector3f::Zero();
};

/// Distance of an object from its target.
struct TargetError {
  double position = 0.0;  ///< [m]
  double angle = 0.0;     ///< [rad]
};

/// What the server has measured of a step last.
struct StepMeasure {
  Tick tick = 0;
  TargetError error;
};

/// What a recording holds that an analysis needs. Topics reach a recorder in no order among each other, and
/// on a busy machine in long batches: each of these is of one topic, in its order, unless it says more.
struct RecordedSession {
  std::string problem;  ///< why the file is incomplete; empty: it is complete
  std::uint64_t messages = 0;
  std::uint64_t malformed = 0;                ///< messages that could not be decoded
  SampleCoverage coverage;                    ///< of the streams that figures rest on
  std::map<std::string, SampleCount> counts;  ///< by topic, as the recorder has counted when it ended
  std::int64_t began_ns = 0;                  ///< [ns] since 1970
  Tick last = 0;                              ///< of all messages

  SessionAnnounce announce;
  RunState run;
  bool has_run = false;
  StepClock clock;
  std::vector<SessionParticipant> participants;
  std::map<ClientId, Presence> present;
  std::map<HandId, HandSeries> hands;
  std::map<ObjectId, std::vector<Tick>> contacts;    ///< of each object; at the end sorted
  std::map<ObjectId, std::vector<Tick>> collisions;  ///< likewise, with what is no hand's own
  std::vector<StepState> steps;
  std::map<std::uint32_t, double> contact_seconds;       ///< [s] by step revision
  std::map<std::uint32_t, StepMeasure> measures;         ///< newest, by step revision
  std::map<ObjectId, std::vector<PathPoint>> positions;  ///< at 100 Hz; at the end sorted
  std::vector<SessionEvent> events;
  std::vector<SessionEvent> client_events;
  std::set<std::string> own_titles;  ///< of objects that hands have by themselves
  std::map<ClientId, ForceLatency> force_latencies;

  Series depth;        ///< [m]
  Series load;         ///< [%]
  Series compute;      ///< [s]
  Series compute_max;  ///< [s]
  std::uint64_t late_ticks = 0;
  std::uint64_t slow_writes = 0;     ///< TickStats::slow_writes
  std::uint64_t unsent_samples = 0;  ///< TickStats::unsent_samples
  double input_age = 0.0;            ///< [s]

  double assisted_seconds = 0.0;  ///< [s] in which the instructor's pointer was in contact
  bool indexed = false, guided = false, external_force = false;
  std::map<std::string, int> commands;  ///< number by what was done

  /// Whether the object is in contact. Not before the reading is finished.
  [[nodiscard]] bool touches(ObjectId object, Tick tick) const;
};

/// Reads a recording. Of a truncated one, what can be read, and `problem` says so; fails with a sentence when
/// the file holds no message.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<RecordedSession> readRecording(const std::filesystem::path& file);

}  // namespace tenon::report
