#include "idl/wire/participant.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <mutex>
#include <string_view>
#include <utility>

#include <dds/dds.h>

#include "idl/threads/scheduling.h"
#include "idl/wire/entities.h"
#include "idl/wire/network.h"
#include "idl/wire/profiles.h"

namespace tenon::wire {
namespace {

struct Domain {
  dds_entity_t entity = 0;
  std::string config;
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
    const auto network = chosenNetwork();
    if (!network) return tl::unexpected(network.error());
    return networkConfig(*network);
  }
  if (config.find('<') != std::string::npos || config.starts_with("file://")) return config;
  std::error_code error;
  const auto path = std::filesystem::absolute(config, error);
  if (error || !std::filesystem::is_regular_file(path, error)) {
    return fail(config + ": there is no such DDS configuration file");
  }
  return "file://" + path.string();
}

/// " on the network 'wan,10.0.0.5'": for what goes wrong on one that was chosen. CYCLONEDDS_URI may be why.
std::string ofNetwork(const LinkOptions& options) {
  const auto network = options.config.empty() ? chosenNetwork() : Result<Network>(Network{});
  if (!network || network->text.empty()) return "";
  if (network->reach == Reach::kConfig) return " by CYCLONEDDS_URI, '" + network->text + "'";
  const char* const uri = std::getenv("CYCLONEDDS_URI");
  const std::string more =
      uri != nullptr && *uri != '\0' ? " with CYCLONEDDS_URI, '" + std::string(uri) + "'" : "";
  return " on the network '" + network->text + "'" + more;
}

Result<std::shared_ptr<void>> openDomain(const LinkOptions& options) {
  static std::mutex mutex;
  static std::map<std::uint32_t, std::weak_ptr<Domain>> open_domains;
  const std::lock_guard<std::mutex> lock(mutex);
  auto domain = open_domains[options.domain].lock();
  if (domain && options.config.empty()) return domain;
  const auto config = configText(options.config);
  if (!config) return tl::unexpected(config.error());
  if (domain) {
    if (domain->config == *config) return domain;
    return fail("DDS domain " + std::to_string(options.domain) + " could not be opened" + ofNetwork(options) +
                ": this process has it open with another configuration, and can have but one");
  }
  const LogCapture log;
  const dds_entity_t entity = dds_create_domain(options.domain, config->c_str());
  if (entity < 0) {
    return fail("DDS domain " + std::to_string(options.domain) + " could not be opened" + ofNetwork(options) +
                ": " + ddsReason(entity) + log.message());
  }
  domain = std::make_shared<Domain>(entity, *config);
  open_domains[options.domain] = domain;
  return domain;
}

}  // namespace

Participant::Participant(std::shared_ptr<ParticipantEntities> entities) : entities_(std::move(entities)) {}
Participant::~Participant() = default;
LinkProfile Participant::profile() const { return entities_->profile; }
Origin Participant::origin() const {
  Origin origin;
  dds_guid_t guid{};
  if (dds_get_guid(entities_->entity, &guid) == DDS_RETCODE_OK)
    std::copy_n(guid.v, origin.guid.size(), origin.guid.begin());
  return origin;
}

Result<std::shared_ptr<Participant>> Participant::open(const LinkOptions& options) {
  auto domain = openDomain(options);
  if (!domain) return tl::unexpected(domain.error());
  auto entities = std::make_shared<ParticipantEntities>();
  entities->domain = *domain;
  entities->profile = options.profile;
  const LogCapture log;
  const std::unique_ptr<dds_qos_t, void (*)(dds_qos_t*)> qos(participantQos(options.profile),
                                                             &dds_delete_qos);
  entities->entity = dds_create_participant(options.domain, qos.get(), nullptr);
  if (entities->entity < 0) {
    return fail("DDS domain " + std::to_string(options.domain) + " could not be joined" + ofNetwork(options) +
                ": " + ddsReason(entities->entity) + log.message());
  }
  return std::shared_ptr<Participant>(new Participant(std::move(entities)));
}

Partition::Partition(const std::shared_ptr<Participant>& participant, std::string name,
                     std::optional<LinkProfile> profile)
    : Partition(participant, std::move(name), profile, {}) {}

Partition::Partition(const std::shared_ptr<Participant>& participant, std::string name,
                     std::optional<LinkProfile> profile, const std::string& also_heard)
    : entities_(std::make_shared<PartitionEntities>()) {
  entities_->profile = profile.value_or(participant->profile());
  entities_->participant = participant->entities();
  entities_->name = std::move(name);
  dds_qos_t* qos = dds_create_qos();
  dds_qset_partition1(qos, entities_->name.c_str());
  const dds_entity_t parent = entities_->participant->entity;
  entities_->publisher = dds_create_publisher(parent, qos, nullptr);
  std::array<const char*, 2> heard{entities_->name.c_str(), also_heard.c_str()};
  dds_qset_partition(qos, also_heard.empty() ? 1 : 2, heard.data());
  entities_->subscriber = dds_create_subscriber(parent, qos, nullptr);
  dds_delete_qos(qos);
}
Partition::~Partition() = default;
Partition::Partition(Partition&&) noexcept = default;
Partition& Partition::operator=(Partition&&) noexcept = default;
const std::string& Partition::name() const { return entities_->name; }
void Partition::hearOnly(const Origin& server) { entities_->server = server; }
LinkProfile Partition::profile() const { return entities_->profile; }

std::string raiseWireThreads() {
  constexpr int kWire = 65;
  // by their names in Cyclone DDS; what they hand over to each other is in this order
  constexpr std::array<threads::NamedPriority, 3> kOfDds{{{"recv", 60}, {"tev", 55}, {"dq.", 50}}};
  const std::string refused = threads::raiseThisThread(kWire);
  return refused.empty() ? threads::raiseThreadsNamed(kOfDds) : refused;
}

std::string handPartition(const std::string& session, HandId hand) {
  return sessionPartition(session) + "/hand/" + std::to_string(hand.value);
}

std::string handPartitions(const std::string& session) { return sessionPartition(session) + "/hand/*"; }

std::string clientPartition(const std::string& session, const Origin& client) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string name = sessionPartition(session) + "/";
  for (const std::uint8_t byte : client.guid) {
    name += kDigits[byte >> 4U];
    name += kDigits[byte & 0xFU];
  }
  return name;
}

}  // namespace tenon::wire
