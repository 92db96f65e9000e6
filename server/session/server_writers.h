#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "idl/types/messages.h"
#include "idl/types/result.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/topics.h"

namespace tenon::session {

/// What a thread has written to the bus.
struct WriteCounts {
  std::uint64_t slow = 0;        ///< took longer than 5 ms: a reader was behind
  std::uint64_t failed = 0;      ///< samples that were not sent
  double longest_seconds = 0.0;  ///< [s]

  /// Counts how long `write` takes; returns what it returns.
  template <class Write>
  bool time(Write write) {
    const auto begin = std::chrono::steady_clock::now();
    const bool written = write();
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    longest_seconds = std::max(longest_seconds, seconds);
    slow += seconds > 5e-3 ? 1 : 0;
    return written;
  }
  [[nodiscard]] WriteCounts operator+(const WriteCounts& other) const {
    return {slow + other.slow, failed + other.failed, std::max(longest_seconds, other.longest_seconds)};
  }
};

/// A writer and its topic, opened together.
template <class M>
struct TopicWriter {
  const wire::Topic<M>& topic;
  std::optional<wire::Writer<M>> writer;
  std::uint64_t samples = 0;  ///< of ticks, since the last PublishedSamples
  WriteCounts* counts = nullptr;

  /// Of the wire thread.
  void send(const M& message) {
    const bool written = counts->time([&] { return writer->write(message).has_value(); });
    counts->failed += written ? 0 : 1;
  }
  /// Writes a sample of a tick.
  void write(const M& message) {
    ++samples;
    send(message);
  }
  Result<void> open(wire::Partition& partition) {
    auto opened = wire::Writer<M>::open(partition, topic);
    if (!opened) return fail(opened.error().what);
    writer.emplace(std::move(*opened));
    return {};
  }
};

/// Writers of the contacts of hands, each in the partition of its hand.
struct HandWriters {
  const wire::Topic<HandManifold>& topic;
  std::vector<wire::Writer<HandManifold>> writers;  ///< by hand
  std::uint64_t samples = 0;                        ///< as TopicWriter::samples
  WriteCounts* counts = nullptr;

  void send(const HandManifold& message) {
    const bool written = counts->time([&] { return writers[message.hand.value].write(message).has_value(); });
    counts->failed += written ? 0 : 1;
  }
  void write(const HandManifold& message) {
    ++samples;
    send(message);
  }
  Result<void> open(std::span<wire::Partition> hands) {
    for (wire::Partition& hand : hands) {
      auto opened = wire::Writer<HandManifold>::open(hand, topic);
      if (!opened) return fail(opened.error().what);
      writers.push_back(std::move(*opened));
    }
    return {};
  }
};

/// All writers of a session's server but those of JournalCopies.
///
/// Threads: one (wire). Real-time: no.
struct ServerWriters {
  TopicWriter<SessionAnnounce> announce{wire::kSessionAnnounce, {}};
  TopicWriter<Welcome> welcome{wire::kWelcome, {}};

  TopicWriter<WorldFrame> frame_1k{wire::kWorldFrame1k, {}};
  TopicWriter<WorldFrame> frame_100{wire::kWorldFrame100, {}};
  TopicWriter<WorldFrame> frame_30{wire::kWorldFrame30, {}};
  HandWriters manifold{wire::kHandManifold, {}};
  HandWriters manifold_50{wire::kHandManifold50, {}};
  TopicWriter<ContactPairs> pairs{wire::kContactPairs100, {}};
  TopicWriter<TickStats> stats{wire::kTickStats100, {}};
  TopicWriter<ObjectSnapshot> snapshot{wire::kObjectSnapshot, {}};
  TopicWriter<SceneObject> object{wire::kSceneObject, {}};
  TopicWriter<SceneHand> hand{wire::kSceneHand, {}};
  TopicWriter<SceneStep> scene_step{wire::kSceneStep, {}};
  TopicWriter<SceneTitle> scene_title{wire::kSceneTitle, {}};
  TopicWriter<SceneSignal> scene_signal{wire::kSceneSignal, {}};
  TopicWriter<StepState> step{wire::kStepState, {}};
  TopicWriter<StepProgress> progress{wire::kStepProgress, {}};
  TopicWriter<RunState> run{wire::kRunState, {}};
  TopicWriter<GrabState> grab{wire::kGrabState, {}};
  TopicWriter<CollisionMatrix> matrix{wire::kCollisionMatrix, {}};
  TopicWriter<CommandAck> ack{wire::kCommandAck, {}};
  TopicWriter<Guidance> guidance{wire::kGuidance, {}};
  TopicWriter<EventLog> event{wire::kEventLog, {}};
  TopicWriter<ClockSync> clock{wire::kClockSync, {}};
  TopicWriter<EmergencyStop> stop{wire::kEmergencyStop, {}};
  TopicWriter<EmergencyClear> clear{wire::kEmergencyClear, {}};
  TopicWriter<NewestRaise> newest_raise{wire::kNewestRaise, {}};
  TopicWriter<PublishedSamples> published{wire::kPublishedSamples, {}};

  auto inLobby() { return std::tie(announce, welcome); }
  auto inSession() {
    return std::tie(frame_1k, frame_100, frame_30, pairs, stats, snapshot, object, hand, scene_step,
                    scene_title, scene_signal, step, progress, run, grab, matrix, ack, guidance, event, clock,
                    stop, clear, newest_raise, published);
  }
  auto ofHands() { return std::tie(manifold, manifold_50); }
  /// Written in ticks by send(OutgoingMessages), with the tick in each sample, and recorded.
  auto ofTicks() {
    return std::tie(frame_1k, frame_100, frame_30, manifold, pairs, stats, snapshot, progress, grab);
  }

  /// Opens all, of `hands` by hand; what they write is counted in `counts`, which must outlive this.
  Result<void> open(wire::Partition& lobby, wire::Partition& session, std::span<wire::Partition> hands,
                    WriteCounts& counts) {
    Result<void> result;
    const auto open_in = [&](auto&& where, auto writers) {
      const auto open_one = [&](auto& out) {
        out.counts = &counts;
        if (result) result = out.open(where);
      };
      std::apply([&](auto&... out) { (open_one(out), ...); }, writers);
    };
    open_in(lobby, inLobby());
    open_in(session, inSession());
    open_in(hands, ofHands());
    return result;
  }
};

}  // namespace tenon::session
