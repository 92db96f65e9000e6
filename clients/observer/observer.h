#pragma once

#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "idl/types/messages.h"

namespace tenon {

struct ObserverOptions {
  bool json = false;
  std::string language = "en";
  std::FILE* out = stdout;
};

/// Tells what happens in a session as a person wants to follow it, or as one line of JSON each.
///
/// Told is what changes: steps, contacts that begin, events, people, the run's end; of a step that goes on,
/// where it stands once in a while.
///
/// Threads: one. Real-time: no.
class Observer {
 public:
  explicit Observer(ObserverOptions options) : options_(std::move(options)) {}

  void hear(const SceneObject& object) {
    titles_[object.object] = object.title.empty() ? object.name : object.title;
  }
  void hear(const StepState& step);
  void hear(const StepProgress& progress);
  void hear(const ContactPairs& pairs);
  void hear(const EventLog& event);
  void hear(const Presence& presence);
  void hear(const EmergencyStop& stop);
  void hear(const RunState& run);

  [[nodiscard]] bool over() const;
  /// 0 when everything was mounted.
  [[nodiscard]] int exitCode() const { return run_.phase == RunPhase::kSucceeded ? 0 : 1; }

 private:
  [[nodiscard]] std::string titleOf(ObjectId object) const;
  [[nodiscard]] std::string in(const std::vector<LocalizedText>& texts) const;
  void say(const std::string& line) const;

  ObserverOptions options_;
  std::map<ObjectId, std::string> titles_;
  std::map<std::pair<ObjectId, ObjectId>, bool> touching_;
  std::map<ClientId, bool> people_;
  StepState step_;
  RunState run_;
  Tick told_progress_ = 0;
};

}  // namespace tenon
