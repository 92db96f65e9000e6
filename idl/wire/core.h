#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <vector>

#include <dds/dds.h>

#include "idl/wire/endpoint.h"
#include "idl/wire/profiles.h"

/// The DDS entities behind endpoint.h and tap.h, independent of message types. Internal to idl/wire.
namespace tenon::wire {

struct Participant::Impl {
  std::shared_ptr<void> domain;  ///< shared by all participants of this domain in the process
  dds_entity_t entity = 0;
  LinkProfile profile = LinkProfile::kLan;
  std::mutex topics_mutex;
  std::map<std::string, dds_entity_t, std::less<>> topics;

  ~Impl() { dds_delete(entity); }
};

struct Partition::Impl {
  std::shared_ptr<Participant> participant;
  std::string name;
  LinkProfile profile = LinkProfile::kLan;
  dds_entity_t publisher = 0;
  dds_entity_t subscriber = 0;

  ~Impl() {
    dds_delete(publisher);
    dds_delete(subscriber);
  }
};

}  // namespace tenon::wire

namespace tenon::wire {

/// A DDS reader or writer; keeps its partition alive.
class Endpoint {
 public:
  Endpoint(std::shared_ptr<Partition::Impl> partition, dds_entity_t entity)
      : partition_(std::move(partition)), entity_(entity) {}
  ~Endpoint() { dds_delete(entity_); }
  Endpoint(const Endpoint&) = delete;
  Endpoint& operator=(const Endpoint&) = delete;
  [[nodiscard]] dds_entity_t entity() const { return entity_; }
  [[nodiscard]] const std::shared_ptr<Partition::Impl>& partition() const { return partition_; }

 private:
  std::shared_ptr<Partition::Impl> partition_;
  dds_entity_t entity_;
};

Result<std::unique_ptr<Endpoint>> openWriter(const Partition& partition, const TopicSpec& topic);
Result<std::unique_ptr<Endpoint>> openReader(const Partition& partition, const TopicSpec& topic,
                                             bool keep_all, const dds_listener_t* listener);

[[nodiscard]] std::size_t matchedWriters(dds_entity_t reader);
[[nodiscard]] std::size_t matchedReaders(dds_entity_t writer);

/// Whether the instance of this sample has ended: disposed or, unless `latched`, without writers. True only
/// for the last taken sample of an instance (sample rank 0), so the end is reported once and after its data.
[[nodiscard]] bool isGone(const dds_sample_info_t& info, bool latched);

/// Caches the origin of each writer of a reader, because the DDS call locks and allocates.
class OriginCache {
 public:
  /// An unknown origin when the writer has gone.
  [[nodiscard]] const Origin& find(dds_entity_t reader, dds_instance_handle_t writer);

 private:
  std::unordered_map<dds_instance_handle_t, Origin> known_;
};

/// "WorldFrame_1k in 's/demo': <text of the DDS return code>"
[[nodiscard]] std::string ddsError(std::string_view what, const Partition::Impl& partition,
                                   dds_return_t code);

inline constexpr int kTakeBatch = 64;

/// A reader of one topic and the handling of its samples, for a ReaderWaitSet.
class Subscription {
 public:
  virtual ~Subscription() = default;
  /// Takes and handles up to kTakeBatch samples; returns their number.
  virtual std::size_t takeBatch() = 0;

  std::string topic;
  std::atomic<bool> pending{false};  ///< set by DDS: there may be samples to take
  int wake_fd = -1;
  std::unique_ptr<Endpoint>
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
