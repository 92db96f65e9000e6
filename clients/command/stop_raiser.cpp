#include "clients/command/stop_raiser.h"

#include <algorithm>
#include <utility>

#include "idl/types/messages/session.h"
#include "idl/wire/identity.h"

namespace tenon::command {

namespace {
using std::chrono::milliseconds;
constexpr milliseconds kLateReaders{300};  // although a server has answered, others may not be discovered yet
constexpr milliseconds kAcknowledged{500};
}  // namespace

Result<std::string> outcomeOf(const StopHeard& heard, std::uint32_t domain, const std::string& session) {
  if (heard.by_server) return "accepted";
  if (heard.programs == 0)
    return fail("nobody has heard the emergency stop: no program of " +
                (session.empty() ? "any session" : "session '" + session + "'") + " runs on domain " +
                std::to_string(domain));
  return "sent to " + std::to_string(heard.programs) +
         " programs; no server has answered: it may hang or have ended";
}

Result<std::unique_ptr<StopRaiser>> StopRaiser::open(std::uint32_t domain, const std::string& session,
                                                     std::string person) {
  auto participant =
      wire::Participant::open({.domain = domain, .profile = wire::LinkProfile::kLan, .config = {}});
  if (!participant) return fail(participant.error().what);
  std::unique_ptr<StopRaiser> raiser(new StopRaiser());
  StopRaiser& self = *raiser;
  self.guid_ = wire::hexText(wire::SeatKey::random().seed).substr(0, 32);
  self.person_ = std::move(person);
  self.lobby_ = std::make_unique<wire::Partition>(*participant, wire::kLobby);
  // DDS matches the asterisk with every session's partition
  self.session_ = std::make_unique<wire::Partition>(*participant,
                                                    wire::sessionPartition(session.empty() ? "*" : session));
  Result<void> all = openInto(self.stops_, *self.session_, wire::kEmergencyStop);
  if (all)
    all = self.inbox_.onFrom<EmergencyStop>(
        *self.session_, wire::kEmergencyStop, [&self](const EmergencyStop& stop, const wire::Origin& from) {
          if (stop.client_guid == self.guid_ && stop.counter == self.counter_)
            self.repeaters_.push_back(from);
        });
  if (all)
    all = self.inbox_.onFrom<SessionAnnounce>(
        *self.lobby_, wire::kSessionAnnounce,
        [&self](const SessionAnnounce&, const wire::Origin& from) { self.servers_.push_back(from); });
  if (!all) return fail(all.error().what);
  // DDS matches this program's own reader at once, and may know of one of another program by now
  self.own_readers_ = std::min<std::size_t>(1, self.stops_->matchedReaders());
  return raiser;
}

Result<StopHeard> StopRaiser::raise(const std::string& reason, milliseconds patience,
                                    const std::atomic<bool>& stop) {
  repeaters_.clear();
  if (auto sent = stops_->write({guid_, ++counter_, person_, reason}); !sent) return fail(sent.error().what);
  const auto begin = std::chrono::steady_clock::now();
  const auto elapsed = [&] { return std::chrono::steady_clock::now() - begin; };
  StopHeard heard;
  while (!stop && elapsed() < patience && !(heard.by_server && elapsed() >= kLateReaders)) {
    inbox_.dispatch(milliseconds(20));
    heard.by_server = std::any_of(repeaters_.begin(), repeaters_.end(), [this](const wire::Origin& origin) {
      return std::find(servers_.begin(), servers_.end(), origin) != servers_.end();
    });
  }
  static_cast<void>(stops_->waitForReaders(kAcknowledged));
  heard.programs = stops_->matchedReaders() - std::min(own_readers_, stops_->matchedReaders());
  if (heard.by_server) heard.programs = std::max<std::size_t>(heard.programs, 1);
  return heard;
}

}  // namespace tenon::command
