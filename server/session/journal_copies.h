#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/messages/journal.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/participant.h"
#include "server/session/journal.h"
#include "server/session/server_writers.h"

namespace tenon::session {

/// Gives each recorder copies of the journal's entries, by writers of its own in a partition of its own
/// (wire::clientPartition): one that hangs keeps neither the others waiting nor, when it is removed, a writer
/// that they need.
///
/// A recorder gets the entries that were kept and that it lacks, and all that follow, in order. What it has
/// not taken is offered again; one that takes nothing for a second is given up. In lockstep each waits for
/// all instead.
///
/// Threads: add and finish from one at a time; admit, dismiss, takeStuck and counts from any. Real-time: no.
class JournalCopies {
 public:
  JournalCopies(std::shared_ptr<wire::Participant> participant, std::string session)
      : participant_(std::move(participant)), session_(std::move(session)) {}

  /// The client that joined as a recorder from this participant gets copies from the next add() on: of the
  /// ticks after `recorded_until`, which it has.
  void admit(ClientId client, const wire::Origin& from, Tick recorded_until = 0);
  /// Its writers are deleted with the next add(). Unknown ids are ignored.
  void dismiss(ClientId client);
  /// Recorders that were given up since the last call.
  [[nodiscard]] std::vector<ClientId> takeStuck();

  void add(const JournalEntry& entry);
  /// Offers the rest and waits until all recorders have it, up to `until`.
  void finish(std::chrono::steady_clock::time_point until);

  /// `failed`: entries that a recorder missed.
  [[nodiscard]] WriteCounts counts() const;

 private:
  using Time = std::chrono::steady_clock::time_point;

  struct Copy {
    Tick tick = 0;
    std::vector<TickInputPart> inputs;
    std::vector<CheckpointPart> checkpoint;
  };
  struct Recorder {
    ClientId client;
    wire::Partition partition;
    wire::Writer<TickInputPart> inputs;
    wire::Writer<CheckpointPart> checkpoints;
    std::uint64_t next = 0;   ///< number of the entry to write
    bool has_first = false;   ///< an entry was written
    bool is_matched = false;  ///< and has arrived
    std::optional<Time> waits_since;
    Time retry_at{};
  };

  void handleRequests();
  struct Request {
    ClientId client;
    std::optional<wire::Origin> from;  ///< none: to be dismissed
    Tick recorded_until = 0;
  };
  void open(const Request& request);
  [[nodiscard]] std::uint64_t firstAfter(Tick tick) const;
  /// False when there is more to write for it.
  bool serve(Recorder& recorder, Time now);
  bool write(Recorder& recorder, const Copy& copy);
  [[nodiscard]] static bool isStuck(const Recorder& recorder, Time now);
  [[nodiscard]] bool inLockstep() const { return participant_->profile() == wire::LinkProfile::kLockstep; }
  [[nodiscard]] std::uint64_t end() const { return first_ + kept_.size(); }

  std::shared_ptr<wire::Participant> participant_;
  std::string session_;
  std::deque<Copy> kept_;
  std::uint64_t first_ = 0;  ///< number of the oldest entry kept
  std::list<Recorder> recorders_;
  WriteCounts counts_;

  mutable std::mutex mutex_;  ///< of what follows
  std::vector<Request> requests_;
  std::vector<ClientId> stuck_;
  WriteCounts shown_counts_;
};

}  // namespace tenon::session
