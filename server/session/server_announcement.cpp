#include "server/session/server_announcement.h"

#include <thread>

#include <fmt/format.h>

#include "server/session/session_lock.h"

namespace tenon::session {
namespace {

constexpr auto kOtherServers = std::chrono::milliseconds(500);  // for their announcements to arrive
// without a sign of life for so long the announcement of a server ends (its lease)
constexpr auto kLapse = wire::kSessionAnnounce.parameters.lease;
// A reader for which this server's lease has expired gets its next end only after another sample.
constexpr auto kAnnounceInterval = std::chrono::seconds(1);
constexpr auto kAfterLapse = std::chrono::seconds(10);  // until those who came meanwhile are discovered

}  // namespace

Result<void> ServerAnnouncement::refuseBesideAnother(wire::Partition& lobby, const std::string& session) {
  auto reader = wire::Reader<SessionAnnounce>::open(lobby, wire::kSessionAnnounce);
  if (!reader) return fail(reader.error().what);
  const auto until = std::chrono::steady_clock::now() + kOtherServers;
  SessionAnnounce other;
  while (std::chrono::steady_clock::now() < until) {
    while (reader->take(other))
      if (other.session == session)
        return fail(servedAlready(other.session, std::to_string(other.pid), other.host));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return {};
}

void ServerAnnouncement::announce() {
  announced_at_ = std::chrono::steady_clock::now();
  writers_.announce.send(content_);
}

bool ServerAnnouncement::isAnother(const SessionAnnounce& other) {
  return other.session == content_.session && others_.emplace(other.server_epoch, other).second;
}

void ServerAnnouncement::forget(const SessionAnnounce& gone) {
  if (gone.session == content_.session) others_.erase(gone.server_epoch);
}

void ServerAnnouncement::step() {
  const auto now = std::chrono::steady_clock::now();
  if (now - announced_at_ > kAnnounceInterval) announce();
  if (stepped_ && now - *stepped_ > kLapse) lapsed_ = now;
  stepped_ = now;
  if (!lapsed_) return;
  for (const auto& [epoch, other] : others_)
    if (epoch > content_.server_epoch)
      replaced_ = fmt::format(
          "this server was stopped for a while, and process {} on host {} serves session '{}' now: this one "
          "ends",
          other.pid, other.host, other.session);
  if (now - *lapsed_ > kAfterLapse) lapsed_.reset();
}

}  // namespace tenon::session
