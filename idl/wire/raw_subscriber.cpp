#include "idl/wire/raw_subscriber.h"

#include <algorithm>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <utility>

#include "idl/wire/convert.h"
#include "idl/wire/dds_endpoint.h"
#include "idl/wire/reader_wait_set.h"
#include "idl/wire/sample.h"

namespace tenon::wire {
namespace {

const std::vector<TopicSpec>& allSpecs() {
  static const std::vector<TopicSpec> specs = [] {
    std::vector<TopicSpec> list;
    forEachTopic([&list]<class M>(const Topic<M>& topic) {
      list.push_back({topic.name, &TypeOf<M>::descriptor(), topic.qos_class, topic.parameters});
    });
    return list;
  }();
  return specs;
}

Result<TopicSpec> specOf(std::string_view name) {
  for (const TopicSpec& spec : allSpecs()) {
    if (spec.name == name) return spec;
  }
  return fail("unknown topic '" + std::string(name) + "'");
}

class RawSubscription : public Subscription {
 public:
  RawSubscription(const TopicSpec& spec, const std::function<void(const RawSample&)>* const& handler,
                  std::uint64_t& lost)
      : spec_(spec),
        keeps_unheard_(spec.parameters.of_server &&
                       (spec.qos_class == QosClass::kState || spec.parameters.late_joiner_depth > 0)),
        handler_(handler),
        lost_(lost) {}

  [[nodiscard]] bool isRebound() const override { return reader->partition()->server != server_; }

  std::size_t takeBatch() override {
    if (isRebound()) deliverUnheard();
    void* samples[kTakeBatch] = {nullptr};
    dds_sample_info_t infos[kTakeBatch];
    const dds_return_t count = dds_take(reader->entity(), samples, infos, kTakeBatch, kTakeBatch);
    if (count <= 0) return 0;
    for (int i = 0; i < count; ++i) {
      const Origin& from = origins_.find(reader->entity(), infos[i].publication_handle);
      const bool ended = !infos[i].valid_data && !from.known();  // by a writer that is no more
      const bool heard = ended || isHeard(*reader->partition(), spec_.parameters, from);
      if (!heard && !(keeps_unheard_ && from.known() && infos[i].valid_data)) continue;
      encodeSample(*spec_.type, samples[i], bytes_);
      if (!heard) {
        keepUnheard(from, infos[i].publication_handle,
                    {infos[i].source_timestamp, infos[i].instance_handle, bytes_});
        continue;
      }
      const auto give = [&](bool gone) {
        deliver(infos[i].source_timestamp, gone, infos[i].instance_handle, infos[i].publication_handle,
                bytes_);
      };
      if (infos[i].valid_data) give(false);
      if (isGone(infos[i], spec_.parameters.latched)) give(true);
    }
    dds_return_loan(reader->entity(), samples, count);
    return static_cast<std::size_t>(count);
  }

 private:
  struct Unheard {
    std::int64_t source_ns;
    std::uint64_t instance;
    std::vector<std::uint8_t> bytes;
  };
  struct UnheardWriter {
    Origin from;
    bool is_kept = false;
    std::deque<Unheard> samples;
    std::uint64_t lost = 0;
  };
  static constexpr std::size_t kMostUnheardWriters = 16;    ///< lives of servers of one name; of others
  static constexpr std::size_t kMostCountedWriters = 1024;  ///< it is counted what they write

  /// What late joiners get comes once, maybe before it is known that this client will belong to its server.
  /// However much another one writes, it stays.
  void keepUnheard(const Origin& from, std::uint64_t writer, Unheard sample) {
    const bool is_new = !unheard_.contains(writer);
    if (is_new && unheard_.size() >= kMostCountedWriters) {
      ++lost_of_unknown_;
      return;
    }
    UnheardWriter& kept = unheard_[writer];
    if (is_new) kept.from = from, kept.is_kept = unheard_.size() <= kMostUnheardWriters;
    if (!kept.is_kept) {
      ++kept.lost;
      return;
    }
    const std::size_t most = std::max<std::size_t>(2000, 2 * spec_.parameters.late_joiner_depth);
    if (kept.samples.size() >= most) {
      kept.samples.pop_front();
      ++kept.lost;
    }
    kept.samples.push_back(std::move(sample));
  }
  void deliverUnheard() {
    server_ = reader->partition()->server;
    std::uint64_t lost_otherwise = std::exchange(lost_of_unknown_, 0);
    for (const auto& [writer, kept] : std::exchange(unheard_, {})) {
      if (server_ != kept.from) continue;
      lost_otherwise = 0;
      lost_ += kept.lost;
      for (const Unheard& sample : kept.samples)
        deliver(sample.source_ns, false, sample.instance, writer, sample.bytes);
    }
    lost_ += lost_otherwise;
  }
  void deliver(std::int64_t source_ns, bool gone, std::uint64_t instance, std::uint64_t writer,
               std::span<const std::uint8_t> bytes) {
    (*handler_)({spec_.name, spec_.type->m_typename, source_ns, sequence_++, gone, bytes, instance, writer});
  }

  TopicSpec spec_;
  bool keeps_unheard_;
  const std::function<void(const RawSample&)>* const& handler_;  ///< of the current dispatch()
  std::optional<Origin> server_;  ///< that the partition was bound to at the last samples
  std::map<std::uint64_t, UnheardWriter> unheard_;
  std::uint64_t lost_of_unknown_ = 0;  ///< samples of writers beyond those, maybe of the server
  std::uint64_t& lost_;                ///< of all topics
  OriginCache origins_;
  std::uint64_t sequence_ = 0;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace

const std::vector<TopicName>& allTopics() {
  static const std::vector<TopicName> names = [] {
    std::vector<TopicName> list;
    for (const TopicSpec& spec : allSpecs()) list.push_back({spec.name, spec.type->m_typename});
    return list;
  }();
  return names;
}

struct RawSubscriber::Impl {
  ReaderWaitSet wait_set;
  const std::function<void(const RawSample&)>* handler = nullptr;
  std::uint64_t lost = 0;
};

RawSubscriber::RawSubscriber(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RawSubscriber::RawSubscriber(RawSubscriber&&) noexcept = default;
RawSubscriber& RawSubscriber::operator=(RawSubscriber&&) noexcept = default;
RawSubscriber::~RawSubscriber() = default;

Result<RawSubscriber> RawSubscriber::open(Partition& partition, const std::vector<std::string>& topics) {
  RawSubscriber subscriber(std::make_unique<Impl>());
  std::vector<std::string> names = topics;
  if (topics.empty())
    for (const TopicName& name : allTopics()) names.emplace_back(name.topic);
  if (auto added = subscriber.add(partition, names); !added) return tl::unexpected(added.error());
  return subscriber;
}

Result<void> RawSubscriber::add(Partition& partition, const std::vector<std::string>& topics) {
  std::vector<TopicSpec> specs;
  for (const std::string& name : topics) {
    const auto spec = specOf(name);
    if (!spec) return tl::unexpected(spec.error());
    specs.push_back(*spec);
  }
  for (const TopicSpec& spec : specs) {
    auto added = impl_->wait_set.add(std::make_unique<RawSubscription>(spec, impl_->handler, impl_->lost),
                                     partition, spec, true);
    if (!added) return added;
  }
  return {};
}

std::size_t RawSubscriber::dispatch(std::chrono::nanoseconds timeout,
                                    const std::function<void(const RawSample&)>& handler) {
  impl_->handler = &handler;
  const std::size_t count = impl_->wait_set.dispatch(timeout);
  impl_->handler = nullptr;
  return count;
}
std::uint64_t RawSubscriber::lost() const { return impl_->lost; }
void RawSubscriber::wake() noexcept { impl_->wait_set.wake(); }

struct RawWriter::Impl {
  TopicSpec spec;
  std::unique_ptr<DdsEndpoint> endpoint;
};

RawWriter::RawWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RawWriter::RawWriter(RawWriter&&) noexcept = default;
RawWriter& RawWriter::operator=(RawWriter&&) noexcept = default;
RawWriter::~RawWriter() = default;

Result<RawWriter> RawWriter::open(Partition& partition, std::string_view topic) {
  auto impl = std::make_unique<Impl>();
  const auto spec = specOf(topic);
  if (!spec) return tl::unexpected(spec.error());
  impl->spec = *spec;
  auto endpoint = openWriter(partition, *spec);
  if (!endpoint) return tl::unexpected(endpoint.error());
  impl->endpoint = std::move(*endpoint);
  return RawWriter(std::move(impl));
}

Result<void> RawWriter::write(const RawSample& sample) {
  OwnedSample owned(*impl_->spec.type);
  if (!owned.decode(sample.bytes)) {
    return fail(std::to_string(sample.bytes.size()) + " bytes are not a " + impl_->spec.type->m_typename);
  }
  const dds_entity_t writer = impl_->endpoint->entity();
  const dds_return_t code = sample.gone ? dds_dispose_ts(writer, owned.get(), sample.source_ns)
                                        : dds_write_ts(writer, owned.get(), sample.source_ns);
  if (code < 0) return fail(ddsError(impl_->spec.name, *impl_->endpoint->partition(), code));
  return {};
}

std::size_t RawWriter::matchedReaders() const { return wire::matchedReaders(impl_->endpoint->entity()); }

}  // namespace tenon::wire
