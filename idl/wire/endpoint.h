#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "idl/types/result.h"
#include "idl/wire/topics.h"

namespace tenon {

enum class LinkProfile {
  kLan,       ///< loopback or a local network, by the clock
  kLockstep,  ///< every sample arrives: streams are reliable and 32 deep on both sides, nothing expires
};

struct LinkOptions {
  std::uint32_t domain = 0;
  LinkProfile profile = LinkProfile::kLan;
  /// Cyclone DDS configuration: XML text or the path of a file. Empty: CYCLONEDDS_URI if set, else loopback
  /// as in deploy/dds/loopback.xml.
  std::string config;
};

/// Which program put a message on the bus: the GUID of its participant, which the bus gives and checks and no
/// message can claim. All zero: not known, as of a writer that has gone since.
struct Origin {
  std::array<std::uint8_t, 16> guid{};

  [[nodiscard]] bool known() const { return *this != Origin{}; }
  bool operator==(const Origin&) const = default;
};

/// A program's presence on the bus.
///
/// All participants of one domain in one process share what the first one configured, because DDS
/// configures a domain once per process.
///
/// Threads: any. Real-time: no.
class Participant {
 public:
  static Result<std::shared_ptr<Participant>> open(const LinkOptions& options);
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  [[nodiscard]] LinkProfile profile() const;
  /// As others see it on what this participant writes.
  [[nodiscard]] Origin origin() const;

  struct Impl;
  [[nodiscard]] Impl& impl() { return *impl_; }

 private:
  explicit Participant(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// The readers and writers of one DDS partition: "lobby", or a session's own (sessionPartition).
///
/// A partition may follow another link profile than its participant: the lobby is read by the clock before
/// a client knows that the session runs in lockstep.
///
/// Threads: any. Real-time: no.
class Partition {
 public:
  Partition(std::shared_ptr<Participant> participant, std::string name,
            std::optional<LinkProfile> profile = std::nullopt);
  ~Partition();
  Partition(Partition&&) noexcept;
  Partition& operator=(Partition&&) noexcept;

  [[nodiscard]] const std::string& name() const;
  [[nodiscard]] LinkProfile profile() const;

  struct Impl;
  /// Endpoints share it, so they may outlive the Partition.
  [[nodiscard]] const std::shared_ptr<Impl>& impl() const { return impl_; }

 private:
  std::shared_ptr<Impl> impl_;
};

inline constexpr const char* kLobby = "lobby";
[[nodiscard]] inline std::string sessionPartition(const std::string& session) { return "s/" + session; }

/// Puts messages on a topic.
///
/// Threads: one at a time. Real-time: no (the DDS write locks and allocates); it belongs to a wire thread.
/// Of its own it allocates nothing.
template <class M>
class Writer {
 public:
  static Result<Writer> open(Partition& partition, const Topic<M>& topic);
  Writer(Writer&&) noexcept;
  Writer& operator=(Writer&&) noexcept;
  ~Writer();

  /// Fails when a text is longer than tenon.idl allows, or when a reliable event found no room at its
  /// readers in time.
  Result<void> write(const M& message);
  /// Ends the life of the key that `key_holder` carries; readers hear it as gone.
  Result<void> dispose(const M& key_holder);
  [[nodiscard]] std::size_t matchedReaders() const;

 private:
  struct Impl;
  explicit Writer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Takes messages from a topic, one by one, without waiting.
///
/// Threads: one at a time. Real-time: no.
template <class M>
class Reader {
 public:
  static Result<Reader> open(Partition& partition, const Topic<M>& topic);
  Reader(Reader&&) noexcept;
  Reader& operator=(Reader&&) noexcept;
  ~Reader();

  /// The next valid message; false when there is none. Keys that went are passed over: use an Inbox.
  bool take(M& out, Origin* from = nullptr);
  [[nodiscard]] std::size_t matchedWriters() const;

 private:
  struct Impl;
  explicit Reader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// One thread's mail: waits on many topics and calls a handler for each message.
///
/// Topics are served in the order in which they were added, messages of a topic in the order in which they
/// came. A message that cannot be understood is counted, not delivered.
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

  template <class M>
  Result<void> onFrom(Partition& partition, const Topic<M>& topic, HandlerFrom<M> handler);
  template <class M>
  Result<void> on(Partition& partition, const Topic<M>& topic, Handler<M> handler) {
    return onFrom<M>(partition, topic, withoutOrigin<M>(std::move(handler)));
  }

  /// Calls the handler with a message that has only its key fields when a key was disposed or lost its
  /// writers. Who disposed it is its origin; of a key that lost its writers none is known. May be used with
  /// or without on() for the same topic.
  template <class M>
  Result<void> onGoneFrom(Partition& partition, const Topic<M>& topic, HandlerFrom<M> handler);
  template <class M>
  Result<void> onGone(Partition& partition, const Topic<M>& topic, Handler<M> handler) {
    return onGoneFrom<M>(partition, topic, withoutOrigin<M>(std::move(handler)));
  }

  /// Waits until there is mail, wake() was called or the time is over; then calls the handlers for all that
  /// is there. Zero does not wait. Returns how many samples it handled.
  std::size_t dispatch(std::chrono::nanoseconds timeout);

  /// Ends the waiting of dispatch.
  void wake() noexcept;

  /// Samples that could not be understood, since the start.
  [[nodiscard]] std::uint64_t malformed() const;
  /// Writers that the topics of this inbox are matched with, over all topics.
  [[nodiscard]] std::size_t matchedWriters() const;

 private:
  template <class M>
  static HandlerFrom<M> withoutOrigin(Handler<M> handler) {
    return [handler = std::move(handler)](const M& message, const Origin&) { handler(message); };
  }

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tenon
