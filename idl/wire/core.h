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

/// The DDS entities behind endpoint.h and tap.h, without message types. Internal to idl/wire.
namespace tenon {

struct Participant::Impl {
  std::shared_ptr<void> domain;  ///< shared by all participants of it in this process
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

}  // namespace tenon

namespace tenon::wire {

/// Closes a reader or writer, and keeps its partition until then.
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
                                             bool everything, const dds_listener_t* listener);

[[nodiscard]] std::size_t matchedWriters(dds_entity_t reader);
[[nodiscard]] std::size_t matchedReaders(dds_entity_t writer);

/// Whether this sample, the last of its key that was taken (the rank says so: what comes after a valid sample
/// may have none of its own), ends the key. A latched key outlives its writers.
[[nodiscard]] bool isGone(const dds_sample_info_t& info, bool latched);

/// The origins of what one reader gets. Asking DDS takes a lock and memory: done once a writer.
class OriginsOf {
 public:
  [[nodiscard]] const Origin& find(dds_entity_t reader, dds_instance_handle_t writer);

 private:
  std::unordered_map<dds_instance_handle_t, Origin> known_;
};

/// "WorldFrame_1k in 's/demo': <what DDS says>"
[[nodiscard]] std::string because(std::string_view what, const Partition::Impl& partition, dds_return_t code);

inline constexpr int kTakeAtOnce = 64;

/// One topic of a Mailbox: a reader and what is done with its samples.
class Source {
 public:
  virtual ~Source() = default;
  /// Takes up to kTakeAtOnce samples; returns how many there were.
  virtual std::size_t drain() = 0;

  std::string topic;
  std::atomic<bool> pending{false};  ///< DDS said there may be something to take
  int wake_fd = -1;
  std::unique_ptr<Endpoint> reader;  ///< goes first: its listener writes to the members above
};

/// Waits on many readers at once. DDS's own receive thread calls a listener that marks the reader and writes
/// to an eventfd; that is 28 us faster than a DDS waitset, and any thread can end the waiting without a lock.
class Mailbox {
 public:
  Mailbox();
  ~Mailbox();
  Mailbox(const Mailbox&) = delete;
  Mailbox& operator=(const Mailbox&) = delete;

  /// Opens the reader of a source (which the caller has filled) and serves it from now on.
  Result<void> add(std::unique_ptr<Source> source, const Partition& partition, const TopicSpec& topic,
                   bool everything);
  std::size_t dispatch(std::chrono::nanoseconds timeout);
  void wake() noexcept;
  [[nodiscard]] const std::vector<std::unique_ptr<Source>>& sources() const { return sources_; }

 private:
  std::size_t drainAll();
  void waitFor(std::chrono::nanoseconds timeout) const;

  int wake_fd_;
  std::vector<std::unique_ptr<Source>> sources_;
};

}  // namespace tenon::wire
