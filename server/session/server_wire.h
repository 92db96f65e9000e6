#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "idl/types/messages/log.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/identity.h"
#include "server/game_control/scenario.h"
#include "server/session/contributions.h"
#include "server/session/gap_meter.h"
#include "server/session/input_buffer.h"
#include "server/session/journal.h"
#include "server/session/journal_copies.h"
#include "server/session/publisher.h"
#include "server/session/reception.h"
#include "server/session/refusal_log.h"
#include "server/session/scene_loader.h"
#include "server/session/seat_list.h"
#include "server/session/server_announcement.h"
#include "server/session/server_writers.h"
#include "server/session/session_registry.h"
#include "server/session/stop_keeper.h"

namespace tenon::session {

struct WireOptions {
  std::string session;       ///< its name: selects the DDS partition
  std::uint32_t domain = 0;  ///< DDS domain
  bool lockstep = false;
  bool publish_journal = true;  ///< TickInput and Checkpoint are published too
  std::uint32_t server_epoch = 0;
  std::optional<wire::SharedKey> key;  ///< of the session; none: nobody can be admin or instructor
  std::string scene_hash;              ///< asset that lists the display models; empty: none
  double detail = 1.0;                 ///< [-] LoadOptions::detail, for recordings
  LinkLimits limits;                   ///< likewise
  Tick resumed_after = 0;              ///< SessionAnnounce::resumed_after
  std::filesystem::path stop_file;     ///< keeps the raises of the emergency stop; empty: only in memory
  std::filesystem::path seat_file;     ///< keeps the seats for a resume; empty: nothing does
};

/// All DDS endpoints of a session's server, bound to its registry and input buffer.
///
/// Every sample that names a client is accepted only from the DDS participant that has this client's seat,
/// and of requests to join only those that name this session and this life of the server. Samples that cannot
/// be written are dropped: a topic's QoS class says what its readers may rely on.
///
/// Threads: one (wire); send(JournalEntry) from one thread, which may be another; wake from any.
/// Real-time: wake alone.
class ServerWire {
 public:
  /// Opens all endpoints, publishes the scene and the raises of the emergency stop that stand, and announces
  /// the session. Fails when DDS does, another server announces a session of this name, or the stop file is
  /// damaged. The references must outlive the object.
  [[nodiscard]] static Result<std::unique_ptr<ServerWire>> open(const WireOptions& options,
                                                                const LoadedScene& loaded,
                                                                SessionRegistry& registry,
                                                                InputBuffer& input_buffer,
                                                                Publisher& publisher);

  /// Handles all received samples, waiting up to `timeout` for the first, and forwards the registry's changes
  /// to the input buffer.
  void dispatch(std::chrono::nanoseconds timeout);
  /// Ends the waiting of dispatch().
  void wake() noexcept { inbox_.wake(); }
  /// Why this server has to end: it did nothing for so long that it was taken for dead, and another server
  /// has taken its place meanwhile.
  [[nodiscard]] const std::optional<std::string>& replaced() const { return announcement_->replaced(); }
  void send(const OutgoingMessages& outgoing);
  /// Repeats frames and manifolds of the last tick for a client that missed them (lockstep).
  void resendLast();
  void send(const EventLog& event);
  void send(const RunState& run);
  /// States how many samples were written since the last statement (PublishedSamples); without a new tick
  /// nothing.
  void statePublished();
  /// Waits until all readers have what was written to them reliably, for up to `timeout`.
  void waitForReaders(std::chrono::nanoseconds timeout);
  /// To recorders, also to those that join up to kKeptForRecorders entries later; only with
  /// `publish_journal`.
  void send(const JournalEntry& entry);

  /// Raises the emergency stop in the server's own name, unless it is engaged.
  void raiseStop(const std::string& reason);
  /// Says, once `print` is set, that a stop of an earlier life of this session stands.
  void logStandingStops();
  /// Publishes an entry of the log.
  void log(Severity severity, const std::string& kind, const std::string& text);
  /// Removes a client from the session, notifies it, and logs "Ada (trainee) <why>".
  void dismiss(ClientId client, const std::string& why) { reception_->dismiss(client, why); }
  /// The newest DeviceSample::seq received for a hand; 0: none yet.
  [[nodiscard]] std::uint32_t newestSeq(HandId hand) const { return newest_seq_[hand.value]; }
  /// True once after a client repeated the input of the last tick, so its answer was lost (lockstep).
  [[nodiscard]] bool takeResendRequest() { return std::exchange(resend_requested_, false); }
  [[nodiscard]] std::uint64_t refusedInputs() const { return refused_inputs_; }
  /// Of all threads.
  [[nodiscard]] WriteCounts writes() const { return copies_ ? writes_ + copies_->counts() : writes_; }
  /// Tick and phase of `output` decide about what is received from now on.
  void update(const TickOutput& output);

  /// Receives a line for each log entry, for the server's terminal; may be empty.
  std::function<void(const std::string&)> print;

 private:
  ServerWire(const WireOptions& options, std::shared_ptr<wire::Participant> participant,
             SessionRegistry& registry, InputBuffer& input_buffer, Publisher& publisher);

  Result<void> openReaders();
  void sendScene(const LoadedScene& loaded);
  void beginInputs(const Welcome& welcome);
  void handle(const DeviceInput& input, const wire::Origin& from);
  void handle(const Command& command, const wire::Origin& from);
  void answer(const Command& command, const CommandAck& ack, const std::string& who);
  void handleEarlier(const DeviceInput& input, std::uint32_t newest);
  void handle(const ClockSync& sync);
  void handle(const Telemetry& telemetry);
  void logDelay(const std::string& person, const Telemetry& telemetry);
  /// `manifold` with the next number of its hand in `sent`; valid until the next call.
  const HandManifold& numbered(const HandManifold& manifold, std::vector<std::uint32_t>& sent);
  void passFreezeLimit(HandId hand);
  void publishLimits();
  void handle(const SessionAnnounce& other, const wire::Origin& from);
  void handle(const EmergencyStop& stop, const wire::Origin& from);
  void handleGone(const Presence& presence, const wire::Origin& from);
  [[nodiscard]] bool isGenuine(ClientId client, const wire::Origin& from, const std::string& what);
  void engage(const EmergencyStop& stop);
  void clearEmergencyStop(const Command& command, const std::string& who);
  void refuse(const std::string& why);
  void logRefusal(const std::string& why);
  void sendGuidance(const TickOutput& output);
  void forwardChanges();

  WireOptions options_;
  std::shared_ptr<wire::Participant> participant_;
  wire::Partition lobby_;
  wire::Partition session_;
  std::vector<wire::Partition> hands_;
  wire::Inbox inbox_;
  std::unique_ptr<ServerWriters> writers_;
  std::unique_ptr<JournalCopies> copies_;  ///< null: the journal is not published
  std::unique_ptr<SeatKeeper> seats_;      ///< null: nothing keeps them
  SessionRegistry& registry_;
  InputBuffer& input_buffer_;
  Publisher& publisher_;
  StopKeeper stops_;
  std::optional<ServerAnnouncement> announcement_;  ///< from open() on
  std::unique_ptr<Reception> reception_;
  std::vector<std::uint32_t> newest_seq_;  ///< index = HandId
  RefusalLog refusals_;
  std::vector<SceneHand> scene_hands_;  ///< as they were published last
  struct ReceivedInputs {
    std::uint32_t count = 0, newest_seq = 0;
    GapMeter gaps;
    std::chrono::steady_clock::time_point limits_set_at;
    std::uint32_t logged_freeze = HandLimits{}.freeze_ticks;  ///< [ticks] the newest in the log
    bool guidance_alone = false;                              ///< Telemetry::guidance_alone, as logged
  };
  std::map<ClientId, ReceivedInputs> received_inputs_;  ///< ClockSync
  std::uint64_t refused_inputs_ = 0;
  WriteCounts writes_;
  Contributions contributions_;
  bool resend_requested_ = false;
  Tick now_ = 0;
  const OutgoingMessages* last_ = nullptr;     ///< of the last send
  std::vector<std::uint32_t> sent_, sent_50_;  ///< HandManifold::sent of each topic, by hand
  HandManifold numbered_;
  PublishedSamples published_;  ///< since the last statement
};

}  // namespace tenon::session
