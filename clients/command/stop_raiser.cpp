#include "clients/command/stop_raiser.h"

#include <algorithm>
#include <utility>

#include "idl/types/messages/session.h"
#include "idl/types/printable_text.h"
#include "idl/wire/identity.h"

namespace tenon::command {

namespace {
using std::chrono::milliseconds;
constexpr milliseconds kLateReaders{300};  // although a server has answered, others may not be discovered yet
constexpr milliseconds kAcknowledged{500};
constexpr std::size_t kMaxReason = 255;  // [bytes] of tenon::EmergencyStop
constexpr std::size_t kKept = 256;       // raises of which it is known who has heard them

/// Once, however often its announcement is repeated.
void addOnce(std::vector<wire::Origin>& origins, const wire::Origin& origin) {
  if (std::find(origins.begin(), origins.end(), origin) == origins.end()) origins.push_back(origin);
}
}  // namespace

Result<std::string> outcomeOf(const StopHeard& heard, std::uint32_t domain, const std::string& session) {
  if (heard.by_server) return "accepted";
  if (heard.programs == 0)
    return fail("nobody has heard the emergency stop: no program of " +
                (session.empty() ? "any session" : "session '" + session + "'") + " runs on domain " +
                std::to_string(domain));
  const std::string sent =
      "sent to " + std::to_string(heard.programs) + (heard.programs == 1 ? " program" : " programs");
  if (!heard.acknowledged)
    return fail(sent +
                ", and not all of them have acknowledged it: do not rely on it, stop the devices by hand");
  return sent + "; no server has answered: it may hang or have ended";
}

Result<std::unique_ptr<StopRaiser>> StopRaiser::open(std::uint32_t domain, const std::string& session,
                                                     std::string person) {
  auto participant =
      wire::Participant::open({.domain = domain, .profile = wire::LinkProfile::kLan, .config = {}});
  if (!participant) return fail(participant.error().what);
  std::unique_ptr<StopRaiser> raiser(new StopRaiser());
  StopRaiser& self = *raiser;
  self.guid_ = wire::randomHex();
  self.person_ = std::move(person);
  self.lobby_ = std::make_unique<wire::Partition>(*participant, wire::kLobby);
  // DDS matches the asterisk with every session's partition
  self.session_ = std::make_unique<wire::Partition>(*participant,
                                                    wire::sessionPartition(session.empty() ? "*" : session));
  Result<void> all = openInto(self.stops_, *self.session_, wire::kEmergencyStop);
  if (all)
    all = self.inbox_.onFrom<EmergencyStop>(
        *self.session_, wire::kEmergencyStop, [&self](const EmergencyStop& stop, const wire::Origin& from) {
          const auto raise = self.raises_.find(stop.counter);
          if (stop.client_guid == self.guid_ && raise != self.raises_.end())
            addOnce(raise->second.repeaters, from);
        });
  if (all)
    all = self.inbox_.onFrom<SessionAnnounce>(
        *self.lobby_, wire::kSessionAnnounce,
        [&self](const SessionAnnounce&, const wire::Origin& from) { addOnce(self.servers_, from); });
  // not repeated to stations that join after it was cleared
  if (all)
    all = self.inbox_.onFrom<EmergencyClear>(
        *self.session_, wire::kEmergencyClear,
        [&self](const EmergencyClear& cleared, const wire::Origin& from) {
          if (cleared.client_guid == self.guid_ && self.isServer(from))
            static_cast<void>(self.stops_->dispose({cleared.client_guid, cleared.counter, {}, {}}));
        });
  if (!all) return fail(all.error().what);
  // DDS matches this program's own reader at once, and may know of one of another program by now
  self.own_readers_ = std::min<std::size_t>(1, self.stops_->matchedReaders());
  return raiser;
}

Result<StopHeard> StopRaiser::raise(const std::string& reason, milliseconds patience,
                                    const std::atomic<bool>& stop) {
  const auto raised = write(reason);
  if (!raised) return fail(raised.error().what);
  while (!stop && !heard(*raised, patience)) dispatch(milliseconds(20));
  const bool acknowledged = stops_->waitForReaders(kAcknowledged);
  StopHeard outcome = *heard(*raised, milliseconds(0));
  outcome.acknowledged = acknowledged;
  return outcome;
}

Result<std::uint32_t> StopRaiser::write(const std::string& reason) {
  if (auto sent = stops_->write({guid_, ++counter_, person_, shortened(printable(reason), kMaxReason)});
      !sent)
    return fail(sent.error().what);
  raises_.insert_or_assign(counter_, Raise{std::chrono::steady_clock::now(), {}});
  if (raises_.size() > kKept) raises_.erase(raises_.begin());
  return counter_;
}

bool StopRaiser::isServer(const wire::Origin& origin) const {
  return std::find(servers_.begin(), servers_.end(), origin) != servers_.end();
}

std::optional<StopHeard> StopRaiser::heard(std::uint32_t raise, milliseconds patience) const {
  const auto found = raises_.find(raise);
  if (found == raises_.end()) return StopHeard{};
  const auto& [written, repeaters] = found->second;
  const auto elapsed = std::chrono::steady_clock::now() - written;
  StopHeard heard;
  heard.by_server = std::any_of(repeaters.begin(), repeaters.end(),
                                [this](const wire::Origin& origin) { return isServer(origin); });
  if (elapsed < patience && !(heard.by_server && elapsed >= kLateReaders)) return std::nullopt;
  heard.programs = stops_->matchedReaders() - std::min(own_readers_, stops_->matchedReaders());
  if (heard.by_server) heard.programs = std::max<std::size_t>(heard.programs, 1);
  return heard;
}

}  // namespace tenon::command
