#include "idl/wire/core.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <utility>

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

namespace tenon::wire {
namespace {

std::string reason(dds_return_t code) { return dds_strretcode(-code); }

struct Domain {
  dds_entity_t entity = 0;
  ~Domain() { dds_delete(entity); }
};

/// Captures the last log message of Cyclone DDS for an Error, instead of printing it to stderr.
class LogCapture {
 public:
  LogCapture() : lock_(mutex()) { dds_set_log_sink(&LogCapture::sink, this); }
  ~LogCapture() { dds_set_log_sink(nullptr, nullptr); }
  LogCapture(const LogCapture&) = delete;
  LogCapture& operator=(const LogCapture&) = delete;

  [[nodiscard]] std::string message() const { return message_.empty() ? "" : " (" + message_ + ")"; }

 private:
  static std::mutex& mutex() {
    static std::mutex one;
    return one;
  }
  static void sink(void* self, const dds_log_data_t* data) {
    std::string line(data->message, data->size);
    while (!line.empty() && (line.back() == '\n' || line.back() == ' ')) line.pop_back();
    if (!line.empty()) static_cast<LogCapture*>(self)->message_ = std::move(line);
  }
  std::lock_guard<std::mutex> lock_;  ///< the sink is one for the whole process
  std::string message_;
};

Result<std::string> configText(const std::string& config) {
  if (config.empty()) {
    const char* environment = std::getenv("CYCLONEDDS_URI");
    if (environment != nullptr && *environment != '\0') return std::string(environment);
    return std::string(loopbackConfig());
  }
  if (config.find('<') != std::string::npos || config.starts_with("file://")) return config;
  std::error_code error;
  const auto path = std::filesystem::absolute(config, error);
  if (error || !std::filesystem::is_regular_file(path, error)) {
    return fail(config + ": there is no such DDS configuration file");
  }
  return "file://" + path.string();
}

Result<std::shared_ptr<void>> openDomain(const LinkOptions& options) {
  static std::mutex mutex;
  static std::map<std::uint32_t, std::weak_ptr<Domain>> open_domains;
  const std::lock_guard<std::mutex> lock(mutex);
  if (auto domain = open_domains[options.domain].lock()) return domain;
  const auto config = configText(options.config);
  if (!config) return tl::unexpected(config.error());
  const LogCapture log;
  const dds_entity_t entity = dds_create_domain(options.domain, config->c_str());
  if (entity < 0) {
    return fail("DDS domain " + std::to_string(options.domain) + " could not be opened: " + reason(entity) +
                log.message());
  }
  auto domain = std::make_shared<Domain>(entity);
  open_domains[options.domain] = domain;
  return domain;
}

Result<dds_entity_t> topicEntity(Participant::Impl& participant, const TopicSpec& topic) {
  const std::lock_guard<std::mutex> lock(participant.topics_mutex);
  const auto known = participant.topics.find(topic.name);
  if (known != participant.topics.end()) return known->second;
  const std::string name(topic.name);
  const dds_entity_t entity =
      dds_create_topic(participant.entity, topic.type, name.c_str(), nullptr, nullptr);
  if (entity < 0) return fail("topic '" + name + "' could not be created: " + reason(entity));
  participant.topics.emplace(name, entity);
  return entity;
}

template <class Create>
Result<std::unique_ptr<Endpoint>> openEndpoint(const Partition& partition, const TopicSpec& topic,
                                               dds_qos_t* qos, Create create) {
  const std::unique_ptr<dds_qos_t, void (*)(dds_qos_t*)> owned(qos, &dds_delete_qos);
  if (partition.impl()->publisher < 0 || partition.impl()->subscriber < 0) {
    return fail("partition '" + partition.name() + "' could not be opened");
  }
  const auto topic_entity = topicEntity(partition.impl()->participant->impl(), topic);
  if (!topic_entity) return tl::unexpected(topic_entity.error());
  const dds_entity_t entity = create(*topic_entity);
  if (entity < 0) return fail(ddsError(topic.name, *partition.impl(), entity));
  return std::make_unique<Endpoint>(partition.impl(), entity);
}

void markPending(void* subscription) {
  static_cast<Subscription*>(subscription)->pending.store(true, std::memory_order_release);
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written =
      write(static_cast<Subscription*>(subscription)->wake_fd, &one, sizeof(one));
}

}  // namespace

std::string ddsError(std::string_view what, const Partition::Impl& partition, dds_return_t code) {
  return std::string(what) + " in '" + partition.name + "': " + reason(code);
}

Result<std::unique_ptr<Endpoint>> openWriter(const Partition& partition, const TopicSpec& topic) {
  dds_qos_t* qos = writerQos(topic, partition.profile());
  return openEndpoint(partition, topic, qos, [&](dds_entity_t entity) {
    return dds_create_writer(partition.impl()->publisher, entity, qos, nullptr);
  });
}

Result<std::unique_ptr<Endpoint>> openReader(const Partition& partition, const TopicSpec& topic,
                                             bool keep_all, const dds_listener_t* listener) {
  dds_qos_t* qos = readerQos(topic, partition.profile(), keep_all);
  return openEndpoint(partition, topic, qos, [&](dds_entity_t entity) {
    return dds_create_reader(partition.impl()->subscriber, entity, qos, listener);
  });
}

std::size_t matchedWriters(dds_entity_t reader) {
  return static_cast<std::size_t>(std::max(0, dds_get_matched_publications(reader, nullptr, 0)));
}
std::size_t matchedReaders(dds_entity_t writer) {
  return static_cast<std::size_t>(std::max(0, dds_get_matched_subscriptions(writer, nullptr, 0)));
}

const Origin& OriginCache::find(dds_entity_t reader, dds_instance_handle_t writer) {
  static const Origin unknown;
  constexpr std::size_t kManyWriters = 1000;  // bounds the cache in long sessions
  if (const auto found = known_.find(writer); found != known_.end()) return found->second;
  const std::unique_ptr<dds_builtintopic_endpoint_t, void (*)(dds_builtintopic_endpoint_t*)> data(
      dds_get_matched_publication_data(reader, writer), &dds_builtintopic_free_endpoint);
  if (!data) return unknown;
  if (known_.size() >= kManyWriters) known_.clear();
  Origin& origin = known_[writer];
  std::copy_n(data->participant_key.v, origin.guid.size(), origin.guid.begin());
  return origin;
}

bool isGone(const dds_sample_info_t& info, bool latched) {
  if (info.sample_rank != 0) return false;
  return info.instance_state == DDS_NOT_ALIVE_DISPOSED_INSTANCE_STATE ||
         (info.instance_state == DDS_NOT_ALIVE_NO_WRITERS_INSTANCE_STATE && !latched);
}

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
    if (!subscription->pending.exchange(false, std::memory_order_acq_rel)) continue;
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

namespace tenon::wire {

Participant::Participant(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Participant::~Participant() = default;
LinkProfile Participant::profile() const { return impl_->profile; }
Origin Participant::origin() const {
  Origin origin;
  dds_guid_t guid{};
  if (dds_get_guid(impl_->entity, &guid) == DDS_RETCODE_OK)
    std::copy_n(guid.v, origin.guid.size(), origin.guid.begin());
  return origin;
}

Result<std::shared_ptr<Participant>> Participant::open(const LinkOptions& options) {
  auto domain = wire::openDomain(options);
  if (!domain) return tl::unexpected(domain.error());
  auto impl = std::make_unique<Impl>();
  impl->domain = *domain;
  impl->profile = options.profile;
  const wire::LogCapture log;
  impl->entity = dds_create_participant(options.domain, nullptr, nullptr);
  if (impl->entity < 0) {
    return fail("DDS domain " + std::to_string(options.domain) +
                " could not be joined: " + wire::reason(impl->entity) + log.message());
  }
  return std::shared_ptr<Participant>(new Participant(std::move(impl)));
}

Partition::Partition(std::shared_ptr<Participant> participant, std::string name,
                     std::optional<LinkProfile> profile)
    : impl_(std::make_shared<Impl>()) {
  impl_->profile = profile.value_or(participant->profile());
  impl_->participant = std::move(participant);
  impl_->name = std::move(name);
  dds_qos_t* qos = dds_create_qos();
  dds_qset_partition1(qos, impl_->name.c_str());
  const dds_entity_t parent = impl_->participant->impl().entity;
  impl_->publisher = dds_create_publisher(parent, qos, nullptr);
  impl_->subscriber = dds_create_subscriber(parent, qos, nullptr);
  dds_delete_qos(qos);
}
Partition::~Partition() = default;
Partition::Partition(Partition&&) noexcept = default;
Partition& Partition::operator=(Partition&&) noexcept = default;
const std::string& Partition::name() const { return impl_->name; }
LinkProfile Partition::profile() const { return impl_->profile; }

}  // namespace tenon::wire
