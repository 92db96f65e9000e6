#include "idl/wire/raw_subscriber.h"

#include <algorithm>
#include <utility>

#include "idl/wire/convert.h"
#include "idl/wire/core.h"
#include "idl/wire/sample.h"

namespace tenon::wire {
namespace {

const std::vector<wire::TopicSpec>& allSpecs() {
  static const std::vector<wire::TopicSpec> specs = [] {
    std::vector<wire::TopicSpec> list;
    forEachTopic([&list]<class M>(const Topic<M>& topic) {
      list.push_back({topic.name, &wire::TypeOf<M>::descriptor(), topic.qos_class, topic.parameters});
    });
    return list;
  }();
  return specs;
}

Result<wire::TopicSpec> specOf(std::string_view name) {
  for (const wire::TopicSpec& spec : allSpecs()) {
    if (spec.name == name) return spec;
  }
  return fail("unknown topic '" + std::string(name) + "'");
}

class RawSubscription : public wire::Subscription {
 public:
  RawSubscription(const wire::TopicSpec& spec, const std::function<void(const RawSample&)>* const& handler)
      : spec_(spec), handler_(handler) {}

  std::size_t takeBatch() override {
    void* samples[wire::kTakeBatch] = {nullptr};
    dds_sample_info_t infos[wire::kTakeBatch];
    const dds_return_t count = dds_take(reader->entity(), samples, infos, wire::kTakeBatch, wire::kTakeBatch);
    if (count <= 0) return 0;
    for (int i = 0; i < count; ++i) {
      if (infos[i].valid_data) deliver(infos[i], samples[i], false);
      if (wire::isGone(infos[i], spec_.parameters.latched)) deliver(infos[i], samples[i], true);
    }
    dds_return_loan(reader->entity(), samples, count);
    return static_cast<std::size_t>(count);
  }

 private:
  void deliver(const dds_sample_info_t& info, const void* sample, bool gone) {
    wire::encodeSample(*spec_.type, sample, bytes_);
    (*handler_)({spec_.name, spec_.type->m_typename, info.source_timestamp, sequence_++, gone, bytes_});
  }

  wire::TopicSpec spec_;
  const std::function<void(const RawSample&)>* const& handler_;  ///< of the current dispatch()
  std::uint64_t sequence_ = 0;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace

const std::vector<TopicName>& allTopics() {
  static const std::vector<TopicName> names = [] {
    std::vector<TopicName> list;
    for (const wire::TopicSpec& spec : allSpecs()) list.push_back({spec.name, spec.type->m_typename});
    return list;
  }();
  return names;
}

struct RawSubscriber::Impl {
  wire::ReaderWaitSet wait_set;
  const std::function<void(const RawSample&)>* handler = nullptr;
};

RawSubscriber::RawSubscriber(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RawSubscriber::RawSubscriber(RawSubscriber&&) noexcept = default;
RawSubscriber& RawSubscriber::operator=(RawSubscriber&&) noexcept = default;
RawSubscriber::~RawSubscriber() = default;

Result<RawSubscriber> RawSubscriber::open(Partition& partition, const std::vector<std::string>& topics) {
  std::vector<wire::TopicSpec> specs;
  for (const std::string& name : topics) {
    const auto spec = specOf(name);
    if (!spec) return tl::unexpected(spec.error());
    specs.push_back(*spec);
  }
  auto impl = std::make_unique<Impl>();
  for (const wire::TopicSpec& spec : topics.empty() ? allSpecs() : specs) {
    const auto added =
        impl->wait_set.add(std::make_unique<RawSubscription>(spec, impl->handler), partition, spec, true);
    if (!added) return tl::unexpected(added.error());
  }
  return RawSubscriber(std::move(impl));
}

std::size_t RawSubscriber::dispatch(std::chrono::nanoseconds timeout,
                                    const std::function<void(const RawSample&)>& handler) {
  impl_->handler = &handler;
  const std::size_t count = impl_->wait_set.dispatch(timeout);
  impl_->handler = nullptr;
  return count;
}
void RawSubscriber::wake() noexcept { impl_->wait_set.wake(); }

struct RawWriter::Impl {
  wire::TopicSpec spec;
  std::unique_ptr<wire::Endpoint> endpoint;
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
  auto endpoint = wire::openWriter(partition, *spec);
  if (!endpoint) return tl::unexpected(endpoint.error());
  impl->endpoint = std::move(*endpoint);
  return RawWriter(std::move(impl));
}

Result<void> RawWriter::write(const RawSample& sample) {
  wire::OwnedSample owned(*impl_->spec.type);
  if (!owned.decode(sample.bytes)) {
    return fail(std::to_string(sample.bytes.size()) + " bytes are not a " + impl_->spec.type->m_typename);
  }
  const dds_entity_t writer = impl_->endpoint->entity();
  const dds_return_t code = sample.gone ? dds_dispose_ts(writer, owned.get(), sample.source_ns)
                                        : dds_write_ts(writer, owned.get(), sample.source_ns);
  if (code < 0) return fail(wire::ddsError(impl_->spec.name, *impl_->endpoint->partition(), code));
  return {};
}

std::size_t RawWriter::matchedReaders() const { return wire::matchedReaders(impl_->endpoint->entity()); }

}  // namespace tenon::wire
