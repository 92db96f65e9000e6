#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.h"
#include "idl/wire/codec.h"
#include "idl/wire/endpoint.h"

namespace tenon::wire {

/// A serialised sample, as recordings hold it.
struct RawSample {
  std::string_view topic;
  std::string_view type;       ///< fully scoped: "tenon::WorldFrame"
  std::int64_t source_ns = 0;  ///< [ns] since 1970, source timestamp of the writer
  std::uint64_t sequence = 0;  ///< counts the samples of this topic received here, from 0
  bool gone = false;           ///< the instance ended (DDS NOT_ALIVE): `bytes` has only the key fields set
  std::span<const std::uint8_t> bytes;  ///< as by encode(): encapsulation header and CDR
  std::uint64_t instance = 0;           ///< equal for samples of one topic here that have equal keys
  std::uint64_t writer = 0;             ///< equal for samples that one writer wrote
};

/// Names of a topic and of its type.
struct TopicName {
  std::string_view topic;
  std::string_view type;
};
/// All topics, in a fixed order.
[[nodiscard]] const std::vector<TopicName>& allTopics();

/// Subscribes to topics of one partition without decoding their samples, for recorders and gateways.
///
/// Every sample is kept until it is taken. It belongs into a process of its own: a slow one blocks the
/// writers of reliable events, and in the server's process its queue would use the server's memory. The
/// samples of a topic come in order for each key.
///
/// Threads: open and dispatch from one thread; wake from any. Real-time: wake alone.
class RawSubscriber {
 public:
  /// Of the topics named, or of all when `topics` is empty. Fails for an unknown name and when DDS does.
  static Result<RawSubscriber> open(Partition& partition, const std::vector<std::string>& topics = {});
  /// Further topics, of another partition; they are served after those before.
  Result<void> add(Partition& partition, const std::vector<std::string>& topics);
  RawSubscriber(RawSubscriber&&) noexcept;
  RawSubscriber& operator=(RawSubscriber&&) noexcept;
  ~RawSubscriber();

  /// Waits for samples, wake() or the timeout, then calls `handler` for every sample received so far; its
  /// bytes are valid until the handler returns. Returns the number of samples.
  std::size_t dispatch(std::chrono::nanoseconds timeout,
                       const std::function<void(const RawSample&)>& handler);
  /// Samples of the server that is heard that came before it was, and were too many to be kept.
  [[nodiscard]] std::uint64_t lost() const;
  /// Ends the waiting of dispatch().
  void wake() noexcept;

 private:
  struct Impl;
  explicit RawSubscriber(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Writes recorded samples to a topic with their original bytes and source timestamps.
///
/// Threads: one at a time. Real-time: no.
class RawWriter {
 public:
  /// Fails for an unknown topic and when DDS does.
  static Result<RawWriter> open(Partition& partition, std::string_view topic);
  RawWriter(RawWriter&&) noexcept;
  RawWriter& operator=(RawWriter&&) noexcept;
  ~RawWriter();

  /// Writes the sample, or disposes the instance when `sample.gone`. Fails when the bytes are no sample of
  /// this topic; topic and type of the sample are ignored.
  Result<void> write(const RawSample& sample);
  [[nodiscard]] std::size_t matchedReaders() const;

 private:
  struct Impl;
  explicit RawWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tenon::wire
