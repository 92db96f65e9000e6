#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "idl/types/ids.h"
#include "idl/types/result.h"
#include "idl/wire/origin.h"
#include "idl/wire/topics.h"

namespace tenon::wire {

struct ParticipantEntities;  ///< idl/wire/entities.h, internal to idl/wire
struct PartitionEntities;

struct LinkOptions {
  std::uint32_t domain = 0;  ///< DDS domain
  LinkProfile profile = LinkProfile::kLan;
  /// Cyclone DDS configuration: XML text or path of a file. Empty: that of this process's other participants
  /// in the domain, or else of chosenNetwork().
  std::string config;
};

/// A DDS domain participant.
///
/// All participants of one domain in one process use the configuration of the first, because DDS configures a
/// domain once per process and ignores what a later one asks for: that is an error here.
///
/// Threads: any. Real-time: no.
class Participant {
 public:
  /// Fails when the configuration is missing, wrong, or another one than the domain has in this process, or
  /// the domain cannot be joined.
  static Result<std::shared_ptr<Participant>> open(const LinkOptions& options);
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  [[nodiscard]] LinkProfile profile() const;
  /// The origin of all samples that this participant writes.
  [[nodiscard]] Origin origin() const;
  [[nodiscard]] const std::shared_ptr<ParticipantEntities>& entities() const { return entities_; }

 private:
  explicit Participant(std::shared_ptr<ParticipantEntities> entities);
  std::shared_ptr<ParticipantEntities> entities_;
};

/// A DDS publisher and subscriber of one partition: "lobby", that of a session (sessionPartition) or of one
/// of its hands (handPartition). Failures show when endpoints are opened in it.
///
/// A partition may have another link profile than its participant: the lobby uses kLan also for sessions in
/// lockstep, because a client joins it before it knows whether its
/// session is one.
///
/// Threads: any. Real-time: no.
class Partition {
 public:
  Partition(const std::shared_ptr<Participant>& participant, std::string name,
            std::optional<LinkProfile> profile = std::nullopt);
  /// Its readers also hear the partitions that `also_heard` matches: a DDS pattern with `*`.
  Partition(const std::shared_ptr<Participant>& participant, std::string name,
            std::optional<LinkProfile> profile, const std::string& also_heard);
  ~Partition();
  Partition(Partition&&) noexcept;
  Partition& operator=(Partition&&) noexcept;

  [[nodiscard]] const std::string& name() const;
  [[nodiscard]] LinkProfile profile() const;
  /// From now on this partition's readers, open ones too, deliver the topics that a server alone writes
  /// (TopicParameters::of_server) from the participant `server` only, whoever else writes them. Topics that
  /// anybody writes are not affected. To be called by the thread that takes the samples.
  void hearOnly(const Origin& server);
  /// Shared with the endpoints, which may outlive the Partition.
  [[nodiscard]] const std::shared_ptr<PartitionEntities>& entities() const { return entities_; }

 private:
  std::shared_ptr<PartitionEntities> entities_;
};

/// Real-time priorities where the operating system grants them: of a wire thread, which is to be the calling
/// one, and of the threads of DDS in this process that receive, send on time and match. They are lower than
/// those of a tick and of a hand's loop. Returns what was not granted, or an empty string.
///
/// Without them a message waits for a processor as long as any other program's work does.
[[nodiscard]] std::string raiseWireThreads();

inline constexpr const char* kLobby = "lobby";
[[nodiscard]] inline std::string sessionPartition(const std::string& session) { return "s/" + session; }
/// For the contacts of one hand of a session, which its station alone needs: what it does not subscribe to is
/// not sent to it.
[[nodiscard]] std::string handPartition(const std::string& session, HandId hand);
/// The pattern that matches the partitions of all hands of a session, for recorders and gateways.
[[nodiscard]] std::string handPartitions(const std::string& session);
/// For what the server of a session sends to one client alone, by the GUID of its participant.
[[nodiscard]] std::string clientPartition(const std::string& session, const Origin& client);

}  // namespace tenon::wire
