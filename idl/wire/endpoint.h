#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>
#include <utility>

#include "idl/types/result.h"
#include "idl/wire/participant.h"
#include "idl/wire/topics.h"

namespace tenon::wire {

/// Writes messages of type M to a topic.
///
/// Threads: one at a time. Real-time: no, because the DDS write locks and allocates; use it in a wire thread.
template <class M>
class Writer {
 public:
  static Result<Writer> open(Partition& partition, const Topic<M>& topic);
  Writer(Writer&&) noexcept;
  Writer& operator=(Writer&&) noexcept;
  ~Writer();

  /// Fails when a text or list is longer than tenon.idl allows, or when a reliable write is blocked by a slow
  /// reader for longer than the link profile permits.
  Result<void> write(const M& message);
  /// Disposes the instance with the key fields of `key_holder`; readers get it as gone.
  Result<void> dispose(const M& key_holder);
  [[nodiscard]] std::size_t matchedReaders() const;
  /// Waits until all reliable readers have received all samples; false when they have not within `timeout`.
  bool waitForReaders(std::chrono::nanoseconds timeout);

 private:
  struct Impl;
  explicit Writer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Writer<M>::open into `writer`.
template <class M>
Result<void> openInto(std::unique_ptr<Writer<M>>& writer, Partition& partition, const Topic<M>& topic) {
  auto opened = Writer<M>::open(partition, topic);
  if (!opened) return fail(opened.error().what);
  writer = std::make_unique<Writer<M>>(std::move(*opened));
  return {};
}

/// Takes messages of type M from a topic, one by one, without waiting.
///
/// Threads: one at a time. Real-time: no.
template <class M>
class Reader {
 public:
  static Result<Reader> open(Partition& partition, const Topic<M>& topic);
  Reader(Reader&&) noexcept;
  Reader& operator=(Reader&&) noexcept;
  ~Reader();

  /// The next valid message and its origin; false when there is none. Ends of instances are skipped: Inbox
  /// has them.
  bool take(M& out, Origin* from = nullptr);
  [[nodiscard]] std::size_t matchedWriters() const;

 private:
  struct Impl;
  explicit Reader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Waits on many topics in one thread and calls a handler for each message, as a DDS WaitSet with typed
/// readers.
///
/// Topics are served in the order in which they were added, messages of a topic in the order of their
/// reception. An invalid sample (fromWire) is counted and not delivered.
///
/// Threads: on..., onGone... and dispatch from one thread; wake from any.
/// Real-time: wake alone (one non-blocking eventfd write).
class Inbox {
 public:
  Inbox();
  ~Inbox();
  Inbox(Inbox&&) noexcept;
  Inbox& operator=(Inbox&&) noexcept;

  template <class M>
  using Handler = std::function<void(const M&)>;
  template <class M>
  using HandlerFrom = std::function<void(const M&, const Origin&)>;

  /// Adds a handler that also gets the origin of each message. Fails when DDS does, as do the functions
  /// below.
  template <class M>
  Result<void> onFrom(Partition& partition, const Topic<M>& topic, HandlerFrom<M> handler);
  template <class M>
  Result<void> on(Partition& partition, const Topic<M>& topic, Handler<M> handler) {
    return onFrom<M>(partition, topic, withoutOrigin<M>(std::move(handler)));
  }

  /// Calls the handler with a message that has only its key fields when an instance is disposed or, unless
  /// the topic is latched, loses its writers. The origin is the participant that disposed it; unknown when it
  /// lost its writers. May be used with or without on() for the same topic.
  template <class M>
  Result<void> onGoneFrom(Partition& partition, const Topic<M>& topic, HandlerFrom<M> handler);
  template <class M>
  Result<void> onGone(Partition& partition, const Topic<M>& topic, Handler<M> handler) {
    return onGoneFrom<M>(partition, topic, withoutOrigin<M>(std::move(handler)));
  }

  /// Ends all handlers of a topic in this partition; nothing of it is received any more. Not from a handler.
  void end(const Partition& partition, std::string_view topic);

  /// Waits for samples, wake() or the timeout (zero: does not wait), then calls the handlers for all samples
  /// received. Returns their number.
  std::size_t dispatch(std::chrono::nanoseconds timeout);

  /// Ends the waiting of dispatch().
  void wake() noexcept;

  /// Number of invalid samples since the start.
  [[nodiscard]] std::uint64_t malformed() const;
  /// Number of matched writers, summed over all topics.
  [[nodiscard]] std::size_t matchedWriters() const;

 private:
  template <class M>
  static HandlerFrom<M> withoutOrigin(Handler<M> handler) {
    return [handler = std::move(handler)](const M& message, const Origin&) { handler(message); };
  }

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tenon::wire
