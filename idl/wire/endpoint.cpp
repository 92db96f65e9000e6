#include "idl/wire/endpoint.h"

#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "idl/types/messages.h"
#include "idl/wire/convert.h"
#include "idl/wire/dds_endpoint.h"
#include "idl/wire/reader_wait_set.h"

namespace tenon::wire {
namespace {

template <class M>
TopicSpec specOf(const Topic<M>& topic) {
  return {topic.name, &TypeOf<M>::descriptor(), topic.qos_class, topic.parameters};
}

/// Samples on loan from a reader, returned at destruction.
template <class M>
class Loan {
 public:
  explicit Loan(dds_entity_t reader, int max_samples) : reader_(reader) {
    count_ = dds_take(reader, samples_, infos_, static_cast<std::size_t>(max_samples),
                      static_cast<std::uint32_t>(max_samples));
  }
  ~Loan() {
    if (count_ > 0) dds_return_loan(reader_, samples_, count_);
  }
  Loan(const Loan&) = delete;
  Loan& operator=(const Loan&) = delete;

  [[nodiscard]] int size() const { return count_ < 0 ? 0 : count_; }
  [[nodiscard]] const dds_sample_info_t& info(int i) const { return infos_[i]; }
  [[nodiscard]] const typename TypeOf<M>::C& sample(int i) const {
    return *static_cast<const typename TypeOf<M>::C*>(samples_[i]);
  }

 private:
  dds_entity_t reader_;
  void* samples_[kTakeBatch] = {nullptr};
  dds_sample_info_t infos_[kTakeBatch];
  dds_return_t count_ = 0;
};

}  // namespace

template <class M>
struct Writer<M>::Impl {
  std::unique_ptr<DdsEndpoint> endpoint;
  std::string_view topic;
  Wire<M> wire{};

  template <class Put>
  Result<void> put(const M& message, Put dds_put) {
    if (const auto good = toWire(message, wire); !good) return good;
    const dds_return_t code = dds_put(endpoint->entity(), &wire.sample);
    if (code < 0) return fail(ddsError(topic, *endpoint->partition(), code));
    return {};
  }
};

template <class M>
Writer<M>::Writer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
template <class M>
Writer<M>::Writer(Writer&&) noexcept = default;
template <class M>
Writer<M>& Writer<M>::operator=(Writer&&) noexcept = default;
template <class M>
Writer<M>::~Writer() = default;

template <class M>
Result<Writer<M>> Writer<M>::open(Partition& partition, const Topic<M>& topic) {
  auto endpoint = openWriter(partition, specOf(topic));
  if (!endpoint) return tl::unexpected(endpoint.error());
  auto impl = std::make_unique<Impl>();
  impl->endpoint = std::move(*endpoint);
  impl->topic = topic.name;
  return Writer(std::move(impl));
}
template <class M>
Result<void> Writer<M>::write(const M& message) {
  return impl_->put(message, dds_write);
}
template <class M>
Result<void> Writer<M>::dispose(const M& key_holder) {
  return impl_->put(key_holder, dds_dispose);
}
template <class M>
std::size_t Writer<M>::matchedReaders() const {
  return wire::matchedReaders(impl_->endpoint->entity());
}
template <class M>
bool Writer<M>::waitForReaders(std::chrono::nanoseconds timeout) {
  return dds_wait_for_acks(impl_->endpoint->entity(), timeout.count()) == DDS_RETCODE_OK;
}

template <class M>
struct Reader<M>::Impl {
  std::unique_ptr<DdsEndpoint> endpoint;
  TopicParameters parameters;
  OriginCache origins;
};

template <class M>
Reader<M>::Reader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
template <class M>
Reader<M>::Reader(Reader&&) noexcept = default;
template <class M>
Reader<M>& Reader<M>::operator=(Reader&&) noexcept = default;
template <class M>
Reader<M>::~Reader() = default;

template <class M>
Result<Reader<M>> Reader<M>::open(Partition& partition, const Topic<M>& topic) {
  auto endpoint = openReader(partition, specOf(topic), false, nullptr);
  if (!endpoint) return tl::unexpected(endpoint.error());
  auto impl = std::make_unique<Impl>();
  impl->endpoint = std::move(*endpoint);
  impl->parameters = topic.parameters;
  return Reader(std::move(impl));
}
template <class M>
bool Reader<M>::take(M& out, Origin* from) {
  while (true) {
    const dds_entity_t reader = impl_->endpoint->entity();
    const Loan<M> loan(reader, 1);
    if (loan.size() == 0) return false;
    if (!loan.info(0).valid_data || !fromWire(loan.sample(0), out)) continue;
    const Origin& origin = impl_->origins.find(reader, loan.info(0).publication_handle);
    if (!isHeard(*impl_->endpoint->partition(), impl_->parameters, origin)) continue;
    if (from != nullptr) *from = origin;
    return true;
  }
}
template <class M>
std::size_t Reader<M>::matchedWriters() const {
  return wire::matchedWriters(impl_->endpoint->entity());
}

namespace {

template <class M>
class TypedSubscription : public Subscription {
 public:
  TypedSubscription(const Topic<M>& described, std::uint64_t& malformed)
      : parameters_(described.parameters),
        keeps_unheard_(described.qos_class == QosClass::kState && described.parameters.of_server),
        malformed_(malformed) {}

  [[nodiscard]] bool isRebound() const override { return reader->partition()->server != server_; }

  std::size_t takeBatch() override {
    if (isRebound()) deliverUnheard();
    const Loan<M> loan(reader->entity(), kTakeBatch);
    for (int i = 0; i < loan.size(); ++i) deliver(loan.info(i), loan.sample(i));
    return static_cast<std::size_t>(loan.size());
  }

  std::vector<Inbox::HandlerFrom<M>> handlers;
  std::vector<Inbox::HandlerFrom<M>> gone_handlers;

 private:
  void deliver(const dds_sample_info_t& info, const typename TypeOf<M>::C& sample) {
    if (!fromWire(sample, message_)) {
      if (info.valid_data) ++malformed_;
      return;
    }
    if (info.valid_data) {
      const Origin& origin = origins_.find(reader->entity(), info.publication_handle);
      if (!isHeard(*reader->partition(), parameters_, origin)) return keepUnheard(origin);
      for (const auto& handler : handlers) handler(message_, origin);
    }
    if (isGone(info, parameters_.latched)) {
      const bool disposed = info.instance_state == DDS_NOT_ALIVE_DISPOSED_INSTANCE_STATE;
      const Origin who = disposed ? origins_.find(reader->entity(), info.publication_handle) : Origin{};
      if (who.known() && !isHeard(*reader->partition(), parameters_, who)) return;
      for (const auto& handler : gone_handlers) handler(message_, who);
    }
  }

  /// The states of another server come once, maybe before it is known that this client will belong to it.
  void keepUnheard(const Origin& origin) {
    constexpr std::size_t kMany = 2000;
    if (!keeps_unheard_ || !origin.known()) return;
    if (unheard_.size() >= kMany) unheard_.pop_front();
    unheard_.emplace_back(origin, message_);
  }
  void deliverUnheard() {
    server_ = reader->partition()->server;
    for (const auto& [origin, message] : std::exchange(unheard_, {})) {
      if (server_ != origin) continue;
      for (const auto& handler : handlers) handler(message, origin);
    }
  }

  TopicParameters parameters_;
  bool keeps_unheard_;
  std::optional<Origin> server_;  ///< that the partition was bound to at the last samples
  std::deque<std::pair<Origin, M>> unheard_;
  std::uint64_t& malformed_;
  OriginCache origins_;
  M message_;
};

}  // namespace

struct Inbox::Impl {
  ReaderWaitSet wait_set;
  std::uint64_t malformed = 0;

  template <class M>
  Result<TypedSubscription<M>*> subscription(Partition& partition, const Topic<M>& topic) {
    for (const auto& known : wait_set.subscriptions()) {
      if (known->topic == topic.name && known->reader->partition() == partition.entities()) {
        return static_cast<TypedSubscription<M>*>(known.get());
      }
    }
    auto created = std::make_unique<TypedSubscription<M>>(topic, malformed);
    auto* const typed = created.get();
    if (auto added = wait_set.add(std::move(created), partition, specOf(topic), false); !added) {
      return tl::unexpected(added.error());
    }
    return typed;
  }
};

Inbox::Inbox() : impl_(std::make_unique<Impl>()) {}
Inbox::~Inbox() = default;
Inbox::Inbox(Inbox&&) noexcept = default;
Inbox& Inbox::operator=(Inbox&&) noexcept = default;

template <class M>
Result<void> Inbox::onFrom(Partition& partition, const Topic<M>& topic, HandlerFrom<M> handler) {
  auto subscription = impl_->subscription(partition, topic);
  if (!subscription) return tl::unexpected(subscription.error());
  (*subscription)->handlers.push_back(std::move(handler));
  return {};
}

template <class M>
Result<void> Inbox::onGoneFrom(Partition& partition, const Topic<M>& topic, HandlerFrom<M> handler) {
  auto subscription = impl_->subscription(partition, topic);
  if (!subscription) return tl::unexpected(subscription.error());
  (*subscription)->gone_handlers.push_back(std::move(handler));
  return {};
}

void Inbox::end(const Partition& partition, std::string_view topic) {
  impl_->wait_set.remove(partition, topic);
}

std::size_t Inbox::dispatch(std::chrono::nanoseconds timeout) { return impl_->wait_set.dispatch(timeout); }
void Inbox::wake() noexcept { impl_->wait_set.wake(); }
std::uint64_t Inbox::malformed() const { return impl_->malformed; }

std::size_t Inbox::matchedWriters() const {
  std::size_t count = 0;
  for (const auto& subscription : impl_->wait_set.subscriptions()) {
    count += wire::matchedWriters(subscription->reader->entity());
  }
  return count;
}

#define TENON_INSTANTIATE(M)                                                           \
  template class Writer<M>;                                                            \
  template class Reader<M>;                                                            \
  template Result<void> Inbox::onFrom<M>(Partition&, const Topic<M>&, HandlerFrom<M>); \
  template Result<void> Inbox::onGoneFrom<M>(Partition&, const Topic<M>&, HandlerFrom<M>);
TENON_WIRE_MESSAGES(TENON_INSTANTIATE)
#undef TENON_INSTANTIATE

}  // namespace tenon::wire
