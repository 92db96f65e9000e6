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

namespace tenon {

/// A sample as a recorder keeps it and a replay writes it.
struct RawSample {
  std::string_view topic;
  std::string_view type;                ///< fully scoped: "tenon::WorldFrame"
  std::int64_t source_ns = 0;           ///< when it was written, on the writer's clock [ns since 1970]
  std::uint64_t sequence = 0;           ///< counts what the tap got of this topic, from 0
  bool gone = false;                    ///< its key ended: `bytes` is a sample with only the key fields set
  std::span<const std::uint8_t> bytes;  ///< encapsulation and CDR, as encode() makes them
};

/// The names of all topics, in a fixed order, and of their types.
struct TopicName {
  std::string_view topic;
  std::string_view type;
};
[[nodiscard]] const std::vector<TopicName>& allTopics();

/// Everything on the bus of one partition, undecoded: for recorders and gateways.
///
/// It keeps every sample until it is taken. So it belongs into a process of its own: one that is slow would
/// hold up the writers of reliable events, and in the server's process it would eat its memory. Samples of
/// a topic come in order for each key.
///
/// Threads: open and dispatch from one thread; wake from any. Real-time: wake alone.
class Tap {
 public:
  /// `topics` empty: all of them.
  static Result<Tap> open(Partition& partition, const std::vector<std::string>& topics = {});
  Tap(Tap&&) noexcept;
  Tap& operator=(Tap&&) noexcept;
  ~Tap();

  /// Waits until there is something, wake() was called or the time is over; then hands over all that is
  /// there. The bytes live until the handler returns. Returns how many samples there were.
  std::size_t dispatch(std::chrono::nanoseconds timeout,
                       const std::function<void(const RawSample&)>& handler);
  void wake() noexcept;

 private:
  struct Impl;
  explicit Tap(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Puts recorded samples on a topic again, byte for byte and with the time they had.
///
/// Threads: one at a time. Real-time: no.
class RawWriter {
 public:
  static Result<RawWriter> open(Partition& partition, std::string_view topic);
  RawWriter(RawWriter&&) noexcept;
  RawWriter& operator=(RawWriter&&) noexcept;
  ~RawWriter();

  /// Writes, or disposes when `sample.gone`. Bytes that are no sample of this topic are an error; the
  /// sample's topic and type are not looked at.
  Result<void> write(const RawSample& sample);
  [[nodiscard]] std::size_t matchedReaders() const;

 private:
  struct Impl;
  explicit RawWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tenon
