#pragma once

#include <cstdio>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "idl/types/messages.h"

namespace tenon::observer {

struct ObserverOptions {
  bool json = false;            ///< one JSON object per line instead of sentences
  std::string language = "en";  ///< of titles and instructions
  std::FILE* out = stdout;
};

/// Prints what happens in a session, as sentences or as one JSON object per line.
///
/// Prints changes only: steps, contacts that begin, events, participants, the phase of the run; and the
/// progress of the active step every 2 s. In sentences it omits that a hand takes or releases its own
/// pointer.
///
/// Threads: one. Real-time: no.
class Observer {
 public:
  explicit Observer(ObserverOptions options) : options_(std::move(options)) {}

  void receive(const SceneObject& object);
  void receive(const StepState& step);
  void receive(const StepProgress& progress);
  void receive(const ContactPairs& pairs);
  void receive(const EventLog& event);
  void receive(const Presence& presence);
  void receive(const EmergencyStop& stop);
  void receive(const RunState& run);

  [[nodiscard]] bool over() const;
  /// 0 when the session succeeded, else 1.
  [[nodiscard]] int exitCode() const { return run_.phase == RunPhase::kSucceeded ? 0 : 1; }

 private:
  [[nodiscard]] std::string titleOf(ObjectId object) const;
  [[nodiscard]] std::string localized(const std::vector<LocalizedText>& texts) const;
  void print(const std::string& line) const;

  ObserverOptions options_;
  std::map<ObjectId, std::string> titles_;
  std::set<std::string> pointer_titles_;  ///< of the objects that hands hold when they hold nothing else
  std::map<std::pair<ObjectId, ObjectId>, bool> touching_;
  std::map<ClientId, bool> participants_;  ///< present
  StepState step_;
  RunState run_;
  Tick last_progress_ = 0;  ///< printed
};

}  // namespace tenon::observer
