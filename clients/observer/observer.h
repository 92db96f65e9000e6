#pragma once

#include <cstdio>
#include <map>
#include <string>
#include <utility>

#include "clients/observer/timeline.h"
#include "idl/types/messages.h"
#include "idl/types/stop_truth.h"

namespace tenon::observer {

struct ObserverOptions {
  bool json = false;            ///< one JSON object per line instead of sentences
  std::string language = "en";  ///< of titles and instructions
  std::FILE* out = stdout;
};

/// Prints what happens in a session: sentences in order of time (see Timeline), or one JSON object per line
/// as messages arrive.
///
/// JSON has changes only: steps, contacts that begin or end, events, participants, the phase of the run;
/// and the progress of the active step every 2 s.
///
/// Threads: one. Real-time: no.
class Observer {
 public:
  explicit Observer(ObserverOptions options)
      : options_(std::move(options)), timeline_(options_.out, options_.language) {}

  void receive(const SceneObject& object) { timeline_.receive(object); }
  void receive(const GrabState& grab) { timeline_.receive(grab); }
  void receive(const StepState& step);
  void receive(const StepProgress& progress);
  void receive(const ContactPairs& pairs);
  void receive(const EventLog& event);
  void receive(const Presence& presence);
  void receive(const EmergencyStop& stop);
  void receive(const EmergencyClear& cleared);
  void receive(const RunState& run);

  /// Prints the sentences that waited long enough: those received before `limit` and all earlier ones.
  void printReceivedBefore(Timeline::Clock::time_point limit) { timeline_.printReceivedBefore(limit); }
  void printAll() { timeline_.printAll(); }

  [[nodiscard]] bool over() const { return isOver(run_.phase); }
  /// 0 when the session succeeded, else 1.
  [[nodiscard]] int exitCode() const { return run_.phase == RunPhase::kSucceeded ? 0 : 1; }

 private:
  void printJson(const std::string& line) const;

  ObserverOptions options_;
  Timeline timeline_;
  std::map<std::pair<ObjectId, ObjectId>, bool> touching_;
  std::map<ClientId, bool> participants_;  ///< present
  StepState step_;
  RunState run_;
  StopTruth stops_;
  Tick last_progress_ = 0;  ///< printed
};

}  // namespace tenon::observer
