#include "idl/wire/participant.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <mutex>
#include <utility>

#include <dds/dds.h>

#include "idl/wire/entities.h"
#include "idl/wire/profiles.h"

namespace tenon::wire {
namespace {

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
    return fail("DDS domain " + std::to_string(options.domain) +
                " could not be opened: " + ddsReason(entity) + log.message());
  }
  auto domain = std::make_shared<Domain>(entity);
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
  entities->entity = dds_create_participant(options.domain, nullptr, nullptr);
  if (entities->entity < 0) {
    return fail("DDS domain " + std::to_string(options.domain) +
                " could not be joined: " + ddsReason(entities->entity) + log.message());
  }
  return std::shared_ptr<Participant>(new Participant(std::move(entities)));
}

Partition::Partition(const std::shared_ptr<Participant>& participant, std::string name,
                     std::optional<LinkProfile> profile)
    : entities_(std::make_shared<PartitionEntities>()) {
  entities_->profile = profile.value_or(participant->profile());
  entities_->participant = participant->entities();
  entities_->name = std::move(name);
  dds_qos_t* qos = dds_create_qos();
  dds_qset_partition1(qos, entities_->name.c_str());
  const dds_entity_t parent = entities_->participant->entity;
  entities_->publisher = dds_create_publisher(parent, qos, nullptr);
  entities_->subscriber = dds_create_subscriber(parent, qos, nullptr);
  dds_delete_qos(qos);
}
Partition::~Partition() = default;
Partition::Partition(Partition&&) noexcept = default;
Partition& Partition::operator=(Partition&&) noexcept = default;
const std::string& Partition::name() const { return entities_->name; }
void Partition::hearOnly(const Origin& server) { entities_->server = server; }
LinkProfile Partition::profile() const { return entities_->profile; }

}  // namespace tenon::wire
