#include "clients/command/stop_raiser.h"

#include <algorithm>
#include <set>
#include <utility>

#include "idl/types/messages/session.h"
#include "idl/types/printable_text.h"
#include "idl/wire/identity.h"
#include "idl/wire/joining_names.h"

namespace tenon::command {

namespace {
using std::chrono::milliseconds;
constexpr milliseconds kLateReaders{300};  // although a server has answered, others may not be discovered yet
constexpr milliseconds kListen{20};
constexpr std::size_t kMaxReason = 255;  // [bytes] of tenon::EmergencyStop
constexpr std::size_t kKept = 256;       // raises of which it is known who has heard them
constexpr std::size_t kMostServers = 1024;
constexpr std::size_t kMostRepeaters = 1024;  // of a raise

bool contains(const std::vector<wire::Origin>& origins, const wire::Origin& origin) {
  return std::find(origins.begin(), origins.end(), origin) != origins.end();
}

std::string counted(std::size_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}
}  // namespace

Result<std::string> outcomeOf(const StopHeard& heard, std::uint32_t domain, const std::string& session) {
  if (heard.isConfirmed()) return "accepted";
  if (heard.by_server)
    return "accepted, but not by all: of " + counted(heard.silent_sessions, "session") +
           " no server has answered, it may hang or have ended";
  if (heard.programs == 0)
    return fail("nobody has heard the emergency stop: no program of " +
                (session.empty() ? "any session" : "session '" + session + "'") + " was found on domain " +
                std::to_string(domain));
  const std::string silent = "no server has answered, it may hang or have ended";
  const std::string by_hand = "do not rely on it, stop the devices by hand";
  if (heard.stations == 0)
    return fail("sent to " + counted(heard.programs, "program") + ", and no station has obeyed it; " +
                silent + ": " + by_hand);
  const std::string stopped =
      counted(heard.stations, "station") + (heard.stations == 1 ? " has" : " have") + " stopped";
  if (!heard.acknowledged)
    return fail(stopped + ", and not all that listen have acknowledged it; " + silent + ": " + by_hand);
  return stopped + "; " + silent;
}

Result<std::unique_ptr<StopRaiser>> StopRaiser::open(std::uint32_t domain, const std::string& session,
                                                     const std::string& person) {
  auto participant =
      wire::Participant::open({.domain = domain, .profile = wire::LinkProfile::kLan, .config = {}});
  if (!participant) return fail(participant.error().what);
  std::unique_ptr<StopRaiser> raiser(new StopRaiser());
  StopRaiser& self = *raiser;
  self.guid_ = wire::randomHex();
  self.person_ = shortened(printable(person), wire::kLongestPersonName);
  self.own_ = (*participant)->origin();
  self.lobby_ = std::make_unique<wire::Partition>(*participant, wire::kLobby);
  // DDS matches the asterisk with every session's partition
  self.session_ = std::make_unique<wire::Partition>(*participant,
                                                    wire::sessionPartition(session.empty() ? "*" : session));
  Result<void> all = openInto(self.stops_, *self.session_, wire::kEmergencyStop);
  if (all)
    all = self.inbox_.onFrom<EmergencyStop>(*self.session_, wire::kEmergencyStop,
                                            [&self](const EmergencyStop& stop, const wire::Origin& from) {
                                              if (stop.client_guid == self.guid_ && from != self.own_)
                                                self.repeat(stop.counter, from);
                                            });
  if (all)
    all = self.inbox_.onFrom<SessionAnnounce>(
        *self.lobby_, wire::kSessionAnnounce,
        [&self, session](const SessionAnnounce& announce, const wire::Origin& from) {
          const bool is_meant = session.empty() || announce.session == session;
          const std::pair key{announce.session, announce.server_epoch};
          if (!is_meant) return;
          if (self.servers_.size() < kMostServers || self.servers_.contains(key))
            self.servers_.insert_or_assign(key, Server{from});
          else
            self.has_more_servers_ = true;
        });
  if (all)
    all = self.inbox_.onGone<SessionAnnounce>(
        *self.lobby_, wire::kSessionAnnounce, [&self](const SessionAnnounce& gone) {
          const auto server = self.servers_.find({gone.session, gone.server_epoch});
          if (server != self.servers_.end()) server->second.is_gone = true;
        });
  // not repeated to stations that join after it was cleared
  if (all)
    all = self.inbox_.onFrom<EmergencyClear>(
        *self.session_, wire::kEmergencyClear,
        [&self](const EmergencyClear& cleared, const wire::Origin& from) {
          if (cleared.client_guid != self.guid_ || !self.isServer(from)) return;
          self.repeat(cleared.counter, from);  // the server has heard it, also where others stand for it
          if (cleared.counter >= self.counter_) self.withdraw(self.counter_);
          // somebody else raises under this name, and its clear would name raises that are to come
          if (cleared.counter > self.counter_) self.guid_ = wire::randomHex();
        });
  if (!all) return fail(all.error().what);
  // DDS matches this program's own reader at once, and may know of one of another program by now
  self.own_readers_ = std::min<std::size_t>(1, self.stops_->matchedReaders());
  return raiser;
}

Result<StopHeard> StopRaiser::raise(const std::string& reason, const RaisePatience& patience,
                                    const std::atomic<bool>& stop,
                                    const std::function<void(const StopHeard&)>& tell) {
  const auto raised = write(reason);
  if (!raised) return fail(raised.error().what);
  const auto begin = std::chrono::steady_clock::now();
  auto next_telling = begin + patience.until_told;
  while (true) {
    dispatch(kListen);
    StopHeard known = *heard(*raised, milliseconds(0));
    known.acknowledged = isAcknowledged();
    const auto now = std::chrono::steady_clock::now();
    const auto elapsed = now - begin;
    const bool is_nobody_there = known.programs == 0 && known.silent_sessions == 0;
    if ((known.isConfirmed() && elapsed >= kLateReaders) ||
        (known.isObeyedWithoutServer() && elapsed >= patience.until_told) ||
        (is_nobody_there && elapsed >= patience.to_find) ||
        (patience.in_all && elapsed >= *patience.in_all) || stop)
      return known;
    if (now < next_telling) continue;
    next_telling = now + patience.between_tellings;
    tell(known);
  }
}

Result<std::uint32_t> StopRaiser::write(const std::string& reason) {
  std::erase_if(servers_, [](const auto& server) { return server.second.is_gone; });
  if (auto sent = stops_->write({guid_, ++counter_, person_, shortened(printable(reason), kMaxReason)});
      !sent)
    return fail(sent.error().what);
  withdraw(counter_ - 1);  // the newer one stands for it
  raises_.insert_or_assign(counter_, Raise{std::chrono::steady_clock::now(), {}});
  if (raises_.size() > kKept) raises_.erase(raises_.begin());
  return counter_;
}

/// It is not told any more to programs that come later.
void StopRaiser::withdraw(std::uint32_t raise) {
  if (raise != 0) static_cast<void>(stops_->dispose({guid_, raise, {}, {}}));
}

/// Has heard it, and all before it.
void StopRaiser::repeat(std::uint32_t raise, const wire::Origin& from) {
  if (!from.known()) return;
  for (auto at = raises_.begin(); at != raises_.end() && at->first <= raise; ++at) {
    std::vector<wire::Origin>& repeaters = at->second.repeaters;
    if (repeaters.size() < kMostRepeaters && !contains(repeaters, from)) repeaters.push_back(from);
  }
}

bool StopRaiser::isServer(const wire::Origin& origin) const {
  return std::any_of(servers_.begin(), servers_.end(),
                     [&](const auto& server) { return server.second.origin == origin; });
}

/// One of its servers is enough: a killed one is announced for a while beside the one that resumes.
std::size_t StopRaiser::silentSessions(const std::vector<wire::Origin>& repeaters) const {
  std::set<std::string> silent, answered;
  for (const auto& [name, server] : servers_) {
    if (contains(repeaters, server.origin))
      answered.insert(name.first);
    else if (!server.is_gone)
      silent.insert(name.first);
  }
  const auto count =
      std::count_if(silent.begin(), silent.end(), [&](const auto& name) { return !answered.contains(name); });
  return static_cast<std::size_t>(count) + (has_more_servers_ ? 1 : 0);
}

std::optional<StopHeard> StopRaiser::heard(std::uint32_t raise, milliseconds patience) const {
  const auto found = raises_.find(raise);
  if (found == raises_.end()) return StopHeard{};
  const auto& [written, repeaters] = found->second;
  const auto elapsed = std::chrono::steady_clock::now() - written;
  StopHeard heard;
  const auto servers = std::count_if(repeaters.begin(), repeaters.end(),
                                     [this](const wire::Origin& origin) { return isServer(origin); });
  heard.by_server = servers > 0;
  heard.stations = repeaters.size() - static_cast<std::size_t>(servers);
  heard.silent_sessions = silentSessions(repeaters);
  if (elapsed < patience && !(heard.isConfirmed() && elapsed >= kLateReaders)) return std::nullopt;
  heard.programs = stops_->matchedReaders() - std::min(own_readers_, stops_->matchedReaders());
  heard.programs = std::max(heard.programs, repeaters.size());
  return heard;
}

}  // namespace tenon::command
