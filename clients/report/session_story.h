#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "idl/types/messages.h"
#include "idl/types/result.h"

namespace tenon {

/// A value over session time.
struct SeriesPoint {
  double time = 0.0;  ///< [s] since tick 0
  double value = 0.0;
};
using Series = std::vector<SeriesPoint>;

/// What a trainer asks of a stretch of a session. Forces are those of the trainee's hands.
struct Figures {
  double peak_force = 0.0;       ///< [N] of the coupling on a hand
  double mean_force = 0.0;       ///< [N] over the time in which the hand's object touched something
  double contact_seconds = 0.0;  ///< [s]
  double gap = 0.0;              ///< [m] largest distance between device and proxy
  double depth = 0.0;            ///< [m] deepest point in a field
  double load = 0.0;             ///< [%] largest, paper eq. 2
};

/// One go at a step: from its begin to its end or to the next one's begin.
struct StepVisit {
  std::uint32_t step = 0;
  std::uint32_t revision = 0;  ///< of the StepState that began it
  std::string name;
  std::string title;
  std::string part;
  StepPhase phase = StepPhase::kActive;
  double begin = 0.0;  ///< [s]
  double end = 0.0;    ///< [s]
  Figures figures;
};

struct SessionEvent {
  double time = 0.0;  ///< [s]
  Severity severity = Severity::kInfo;
  std::string kind;
  std::string text;
};

struct Person {
  std::string name;
  Role role = Role::kObserver;
};

/// How an input became a force at one station, as it measured it.
struct ForceAge {
  std::string who;
  double p50 = 0.0, p99 = 0.0, max = 0.0;  ///< [s]
};

/// A recorded session as it is told to a trainer: who did what, when, and how it felt.
///
/// Threads: own it. Real-time: no.
struct SessionStory {
  std::string file;
  std::string problem;  ///< what was wrong with the file, empty for nothing
  std::string session;
  std::string title;
  std::int64_t began_ns = 0;  ///< since 1970
  bool lockstep = false;
  std::vector<Person> people;
  RunState run;
  bool has_run = false;
  std::uint32_t steps = 0;  ///< of the exercise
  std::vector<StepVisit> visits;
  std::vector<SessionEvent> events;
  std::vector<std::string> aids;
  std::vector<ForceAge> force_ages;

  Series trainee_force;     ///< [N] of the hand that feels most
  Series instructor_force;  ///< [N]
  Series gap;               ///< [m] device to proxy, trainee's hands
  Series depth;             ///< [m]
  Series load;              ///< [%]
  Series compute;           ///< [s] of one tick, a hundred times a second
  Series compute_max;       ///< [s] largest since the point before

  double duration = 0.0;  ///< [s]
  Figures whole;
  double compute_median = 0.0, compute_p99 = 0.0, compute_worst = 0.0;  ///< [s]
  std::uint64_t late_ticks = 0;
  double input_age = 0.0;  ///< [s] oldest input that a tick used
  std::uint64_t messages = 0;
  std::uint64_t malformed = 0;

  /// The run says it succeeded, and every step was seen to be done.
  [[nodiscard]] bool succeeded() const;
};

/// Reads a recording. One that was cut is told as far as it goes.
[[nodiscard]] Result<SessionStory> readStory(const std::filesystem::path& file,
                                             const std::string& language = "en");

}  // namespace tenon
