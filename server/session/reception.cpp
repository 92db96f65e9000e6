#include "server/session/reception.h"

#include <algorithm>
#include <vector>

#include <fmt/format.h>

#include "idl/types/names.h"
#include "idl/wire/membership.h"

namespace tenon::session {
namespace {

constexpr std::size_t kMostWaiting = 512;
constexpr std::chrono::seconds kBetweenNotices{1};
constexpr std::chrono::seconds kForPresence{10};  // two leases of a lockstep link

}  // namespace

void Reception::receive(const Join& join, const wire::Origin& from) {
  if (join.session != session_.name || join.server_epoch != session_.server_epoch) return;
  const auto same = [&](const auto& waiting) { return waiting.first.client_guid == join.client_guid; };
  if (const auto found = std::find_if(joins_.begin(), joins_.end(), same); found != joins_.end()) {
    *found = {join, from};
  } else if (joins_.size() < kMostWaiting) {
    joins_.emplace_back(join, from);
  }
}

void Reception::handleGone(ClientId client) {
  const Presence* leaver = registry_.findClient(client);
  if (leaver == nullptr || !leaver->alive) return;
  // hands are freed at once
  if (!leaver->hands.empty() || leaves_.size() >= kMostWaiting) return dismiss(client, "has left");
  leaves_.push_back(client);
}

void Reception::step() {
  const auto now = std::chrono::steady_clock::now();
  if (now >= next_change_ && !leaves_.empty()) {
    next_change_ = now + kBetweenTurns;
    dismiss(leaves_.front(), "has left");
    leaves_.pop_front();
  } else if (now >= next_change_ && !joins_.empty()) {
    next_change_ = now + kBetweenTurns;
    const auto [join, from] = std::move(joins_.front());
    joins_.pop_front();
    admit(join, from);
  }
  finishKicks();
  dismissStuckRecorders();
  dismissUnheard();
}

/// Of who ended or hung before the presence was heard, DDS tells no end.
void Reception::dismissUnheard() {
  const auto late = std::find_if(unheard_.begin(), unheard_.end(), [](const auto& one) {
    return std::chrono::steady_clock::now() >= one.second;
  });
  if (late == unheard_.end()) return;
  const ClientId client = late->first;
  unheard_.erase(late);
  handleGone(client);
}

void Reception::admit(const Join& join, const wire::Origin& from) {
  const bool is_new = !registry_.isSeated(join.client_guid);
  const bool is_known = registry_.knowsSeat(join.seat_key);
  const wire::ProofSubject subject{.challenge = challenges_.challengeFor(from, join.client_guid),
                                   .session = session_.name,
                                   .server_epoch = session_.server_epoch,
                                   .client_guid = join.client_guid,
                                   .role = join.role,
                                   .client = from};
  if (is_new && registry_.mustProve(join) && join.seat_proof.empty()) {
    writers_.welcome.send({.client_guid = join.client_guid,
                           .session = session_.name,
                           .server_epoch = session_.server_epoch,
                           .reason = "prove who you are",
                           .challenge = subject.challenge});
    return;
  }
  const JoinProofs proofs{.seat = wire::SeatKey::isProof(join.seat_key, subject, join.seat_proof),
                          .key = session_.key && session_.key->isProof(subject, join.key_proof)};
  const auto holder = registry_.holderOf(join.seat_key);
  const Welcome welcome = registry_.join(join, proofs, now_, from);
  writers_.welcome.send(welcome);
  if (!is_new) return;
  if (welcome.accepted && holder)
    writers_.welcome.send({.client_guid = *holder,
                           .session = session_.name,
                           .server_epoch = session_.server_epoch,
                           .accepted = false,
                           .reason = wire::kSeatTaken,
                           .client = welcome.client,
                           .tick = now_});
  callbacks.seated(welcome);
  if (welcome.accepted) unheard_[welcome.client] = std::chrono::steady_clock::now() + kForPresence;
  if (welcome.accepted && seats_ != nullptr) seats_->keep(registry_.seatsToKeep());
  if (welcome.accepted && copies_ != nullptr && join.role == Role::kRecorder)
    copies_->admit(welcome.client, from, join.recorded_until);
  const char* how = is_known ? "has rejoined" : "has joined";
  callbacks.log(welcome.accepted ? Severity::kInfo : Severity::kWarning, "join",
                welcome.accepted ? fmt::format("{} ({}) {}", join.name, roleName(join.role), how)
                                 : fmt::format("{} may not join: {}", join.name, welcome.reason));
}

void Reception::dismiss(ClientId client, const std::string& why) {
  const Presence* leaver = registry_.findClient(client);
  if (leaver == nullptr || !leaver->alive) return;
  const std::string text = fmt::format("{} ({}) {}", leaver->name, roleName(leaver->role), why);
  registry_.leave(client);
  unheard_.erase(client);
  if (copies_ != nullptr && leaver->role == Role::kRecorder) copies_->dismiss(client);
  seat_lost_notified_.erase(client);  // of an earlier presence
  notifySeatLost(client, why);
  callbacks.log(Severity::kWarning, "leave", text);
  callbacks.left(client);
}

void Reception::notifySeatLost(ClientId client, const std::string& why) {
  const auto now = std::chrono::steady_clock::now();
  const auto last = seat_lost_notified_.find(client);
  if (last != seat_lost_notified_.end() && now - last->second < kBetweenNotices) return;
  seat_lost_notified_[client] = now;
  writers_.welcome.send({.client_guid = registry_.guidOf(client),
                         .session = session_.name,
                         .server_epoch = session_.server_epoch,
                         .accepted = false,
                         .reason = why,
                         .client = client,
                         .tick = now_});
}

bool Reception::dismissKicked(const Command& command, const CommandAck& ack, const std::string& who) {
  const std::vector<ClientId> kicked = registry_.takeKicked();
  if (kicked.empty()) return false;
  const std::uint64_t kept = seats_ != nullptr ? seats_->keep(registry_.seatsToKeep()) : 0;
  for (const ClientId client : kicked) {
    if (const Presence& person = *registry_.findClient(client); !person.alive)
      callbacks.log(Severity::kWarning, "leave",
                    fmt::format("{} ({}) had left, was removed by {}, and may not come back", person.name,
                                roleName(person.role), who));
    dismiss(client, "was removed by " + who);
  }
  kicks_.push_back({command, ack, who, kept});
  finishKicks();
  return true;
}

bool Reception::holds(const Command& command) const {
  return std::any_of(kicks_.begin(), kicks_.end(), [&](const Kick& kick) {
    return kick.command.client == command.client && kick.command.id == command.id;
  });
}

void Reception::finishKicks() {
  while (!kicks_.empty() && (seats_ == nullptr || seats_->isDone(kicks_.front().seats_kept))) {
    const Kick kick = std::move(kicks_.front());
    kicks_.pop_front();
    callbacks.answer(kick.command, kick.ack, kick.who);
  }
}

void Reception::dismissStuckRecorders() {
  if (copies_ == nullptr) return;
  for (const ClientId client : copies_->takeStuck())
    dismiss(client, "does not receive the journal copies; removed until it joins again");
}

}  // namespace tenon::session
