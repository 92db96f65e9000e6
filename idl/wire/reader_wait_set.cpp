#include "idl/wire/reader_wait_set.h"

#include <cstdint>
#include <ctime>
#include <utility>

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

namespace tenon::wire {
namespace {

void markPending(void* subscription) {
  static_cast<Subscription*>(subscription)->pending.store(true, std::memory_order_release);
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written =
      write(static_cast<Subscription*>(subscription)->wake_fd, &one, sizeof(one));
}

}  // namespace

ReaderWaitSet::ReaderWaitSet() : wake_fd_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {}

ReaderWaitSet::~ReaderWaitSet() {
  subscriptions_.clear();  // no listener is called after this
  close(wake_fd_);
}

Result<void> ReaderWaitSet::add(std::unique_ptr<Subscription> subscription, const Partition& partition,
                                const TopicSpec& topic, bool keep_all) {
  subscription->topic = topic.name;
  subscription->wake_fd = wake_fd_;
  const std::unique_ptr<dds_listener_t, void (*)(dds_listener_t*)> listener(
      dds_create_listener(subscription.get()), &dds_delete_listener);
  dds_lset_data_available(listener.get(), [](dds_entity_t, void* self) { markPending(self); });
  // a lost writer ends instances without new data
  dds_lset_liveliness_changed(listener.get(), [](dds_entity_t, const dds_liveliness_changed_status_t,
                                                 void* self) { markPending(self); });
  dds_lset_subscription_matched(listener.get(), [](dds_entity_t, const dds_subscription_matched_status_t,
                                                   void* self) { markPending(self); });
  // the reader is created with its listener: set later, it would miss earlier samples
  auto reader = openReader(partition, topic, keep_all, listener.get());
  if (!reader) return tl::unexpected(reader.error());
  subscription->reader = std::move(*reader);
  markPending(subscription.get());
  subscriptions_.push_back(std::move(subscription));
  return {};
}

void ReaderWaitSet::remove(const Partition& partition, std::string_view topic) {
  std::erase_if(subscriptions_, [&](const auto& subscription) {
    return subscription->topic == topic && subscription->reader->partition() == partition.entities();
  });
}

void ReaderWaitSet::wake() noexcept {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(wake_fd_, &one, sizeof(one));
}

void ReaderWaitSet::waitFor(std::chrono::nanoseconds timeout) const {
  pollfd entry{wake_fd_, POLLIN, 0};
  timespec time{};
  time.tv_sec = static_cast<time_t>(timeout.count() / 1'000'000'000);
  time.tv_nsec = static_cast<long>(timeout.count() % 1'000'000'000);
  ppoll(&entry, 1, &time, nullptr);
}

std::size_t ReaderWaitSet::takeAll() {
  constexpr int kMaxBatches = 64;  // per reader: a fast writer must not occupy the thread
  std::size_t handled = 0;
  for (const auto& subscription : subscriptions_) {
    const bool is_pending = subscription->pending.exchange(false, std::memory_order_acq_rel);
    if (!is_pending && !subscription->isRebound()) continue;
    int batches = 0;
    std::size_t taken = kTakeBatch;
    while (taken == kTakeBatch && batches < kMaxBatches) {
      taken = subscription->takeBatch();
      handled += taken;
      ++batches;
    }
    if (taken == kTakeBatch) markPending(subscription.get());
  }
  return handled;
}

std::size_t ReaderWaitSet::dispatch(std::chrono::nanoseconds timeout) {
  if (timeout.count() > 0) waitFor(timeout);
  std::uint64_t count = 0;
  [[maybe_unused]] const auto got = read(wake_fd_, &count, sizeof(count));
  return takeAll();
}

}  // namespace tenon::wire
