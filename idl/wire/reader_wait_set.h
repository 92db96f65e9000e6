#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.h"
#include "idl/wire/dds_endpoint.h"
#include "idl/wire/participant.h"
#include "idl/wire/profiles.h"

/// Waiting for samples, independent of message types. Internal to idl/wire.
namespace tenon::wire {

inline constexpr int kTakeBatch = 64;

/// A reader of one topic and the handling of its samples, for a ReaderWaitSet.
class Subscription {
 public:
  virtual ~Subscription() = default;
  /// Takes and handles up to kTakeBatch samples; returns their number.
  virtual std::size_t takeBatch() = 0;
  /// Whether there is something to handle without a new sample: Partition::hearOnly has named another server.
  [[nodiscard]] virtual bool isRebound() const { return false; }

  std::string topic;
  std::atomic<bool> pending{false};  ///< set by DDS: there may be samples to take
  int wake_fd = -1;
  std::unique_ptr<DdsEndpoint>
      reader;  ///< last member: deleted first, because its listener writes to those above
};

/// Waits for samples of many readers. A listener, called by the receive thread of DDS, marks the reader and
/// writes to an eventfd: 28 us faster than a DDS WaitSet, and any thread can end the waiting without a lock.
class ReaderWaitSet {
 public:
  ReaderWaitSet();
  ~ReaderWaitSet();
  ReaderWaitSet(const ReaderWaitSet&) = delete;
  ReaderWaitSet& operator=(const ReaderWaitSet&) = delete;

  /// Opens the reader of `subscription` and serves it from now on. `keep_all`: see readerQos.
  Result<void> add(std::unique_ptr<Subscription> subscription, const Partition& partition,
                   const TopicSpec& topic, bool keep_all);
  /// Closes the reader of a topic in a partition, if there is one. Not from within dispatch().
  void remove(const Partition& partition, std::string_view topic);
  /// Waits for samples, wake() or the timeout, then handles all samples received; returns their number.
  std::size_t dispatch(std::chrono::nanoseconds timeout);
  void wake() noexcept;
  [[nodiscard]] const std::vector<std::unique_ptr<Subscription>>& subscriptions() const {
    return subscriptions_;
  }

 private:
  std::size_t takeAll();
  void waitFor(std::chrono::nanoseconds timeout) const;

  int wake_fd_;
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
};

}  // namespace tenon::wire
