#pragma once

#include <chrono>
#include <cstdio>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "idl/types/messages.h"
#include "idl/types/step_clock.h"

namespace tenon::observer {

/// Prints a session as sentences, in order of time, each event once.
///
/// Topics arrive in no order among each other. So a sentence waits until no earlier one can be expected any
/// more (printReceivedBefore), and is made only then: from what had happened by its tick, whenever that
/// arrived. Where two topics report the same event, one is chosen. A step ends where the next one begins, or
/// with the run: StepState carries the tick in which a step began, also when it says that the step is done.
///
/// Not reported: that a hand takes or releases its own object (pointer, forearm, head), that a mounted part
/// is let go, further contacts of two objects in one step, and what comes after the end of the run. Hands
/// whose inputs do not arrive in time are reported together, once a second at most, and that they move again
/// if it took a second.
///
/// Threads: one. Real-time: no.
class Timeline {
 public:
  using Clock = std::chrono::steady_clock;

  Timeline(std::FILE* out, std::string language) : out_(out), language_(std::move(language)) {}

  void receive(const SceneObject& object);
  void receive(const Presence& presence) { participants_[presence.client] = presence; }
  void receive(const GrabState& grab) { grabs_[{grab.object, grab.tick}] = grab.hand; }
  void receive(const StepState& step);
  void receive(const StepProgress& progress);
  void receive(const ContactPairs& pairs);
  void receive(const EventLog& event);
  void receive(const RunState& run);

  /// Prints what was received before `limit`, and with it everything known that happened before that.
  void printReceivedBefore(Clock::time_point limit);
  void printAll() { printReceivedBefore(Clock::time_point::max()); }

  [[nodiscard]] std::string titleOf(ObjectId object) const;

 private:
  /// Order of sentences with the same tick.
  enum class Rank { kParticipant, kRun, kContact, kGrab, kProgress, kStepBegin, kRunEnd, kLeave };
  struct Sentence {
    Clock::time_point received;
    std::function<void()> print;
  };

  void receiveHand(const EventLog& event);
  void add(Tick tick, Rank rank, std::function<void()> print);
  void print(Tick tick, const std::string& text) const;
  void beginStep(const StepState& step);
  void endStep(Tick tick, const char* how);
  void printProgress(const StepProgress& progress);
  void printContact(Tick tick, ObjectId a, ObjectId b);
  void printGrab(const EventLog& event, bool is_taken);
  void printMounted(const EventLog& event);
  void printHands(const EventLog& event, const std::vector<std::string>& names);
  void printEvent(const EventLog& event) const;
  void printRun(const RunState& run);

  [[nodiscard]] std::string stepNumber() const;
  /// Who took an object in a tick; empty when that is not known.
  [[nodiscard]] std::string holderOf(const std::string& title, Tick tick) const;

  std::FILE* out_;
  std::string language_;
  std::multimap<std::pair<Tick, Rank>, Sentence> pending_;

  // as received
  std::map<ObjectId, std::string> titles_;
  std::set<std::string> own_titles_;  ///< of the objects that hands hold when they hold nothing else
  std::map<ClientId, Presence> participants_;
  std::map<std::pair<ObjectId, Tick>, HandId> grabs_;
  StepClock clock_;
  std::map<Tick, StepPhase> step_phases_;  ///< newest of the step that began in that tick
  std::map<std::pair<ObjectId, ObjectId>, bool> touching_;
  std::map<std::string, Tick> frozen_since_;                                ///< by hand
  std::map<std::pair<std::string, Tick>, std::vector<std::string>> hands_;  ///< by kind of event and second
  std::optional<std::pair<RunPhase, std::uint32_t>> run_;                   ///< phase, server epoch

  // as printed
  bool is_over_ = false;
  std::map<std::string, Tick> hands_told_;  ///< newest sentence about hands, by kind of event
  StepState step_;
  bool step_ended_ = true;
  StepProgress progress_;
  Tick last_progress_ = 0;
  std::set<std::pair<ObjectId, ObjectId>> contacts_;  ///< of this step
  std::map<std::string, std::string> holders_;        ///< title -> who took it
  std::pair<std::string, Tick> mounted_;              ///< newest: title, tick
};

}  // namespace tenon::observer
