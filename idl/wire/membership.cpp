#include "idl/wire/membership.h"

#include <cstdio>
#include <random>
#include <thread>
#include <utility>

namespace tenon {
namespace {

using std::chrono::milliseconds;
constexpr milliseconds kAskAgain{500};
constexpr milliseconds kLook{5};

std::string randomName() {
  std::random_device source;
  char text[24];
  std::snprintf(text, sizeof text, "%08x%08x", source(), source());
  return text;
}

std::string named(const std::string& session) {
  return session.empty() ? "a session" : "session '" + session + "'";
}

/// Looks until `done` or the time is over; false then, or when stopped.
template <class Done>
bool waitFor(std::chrono::seconds patience, const std::atomic<bool>& stop,
             const std::function<void()>& meanwhile, Done done) {
  const auto until = std::chrono::steady_clock::now() + patience;
  while (!done()) {
    if (stop || std::chrono::steady_clock::now() >= until) return false;
    if (meanwhile) meanwhile();
    std::this_thread::sleep_for(kLook);
  }
  return true;
}

}  // namespace

Result<std::unique_ptr<Membership>> Membership::find(const MembershipWishes& wishes, const Stop& stop) {
  auto participant = Participant::open({.domain = wishes.domain, .profile = LinkProfile::kLan, .config = {}});
  if (!participant) return fail(participant.error().what);
  std::unique_ptr<Membership> member(new Membership(wishes));
  member->guid_ = randomName();
  member->lobby_ = std::make_unique<Partition>(*participant, kLobby);
  auto announce = member->await(stop, {});
  if (!announce) return fail(announce.error().what);
  member->announce_ = std::move(*announce);
  member->wishes_.session = member->announce_.session;
  const bool lockstep = member->announce_.lockstep && !wishes.only_watches;
  member->session_ = std::make_unique<Partition>(*participant, sessionPartition(member->announce_.session),
                                                 lockstep ? LinkProfile::kLockstep : LinkProfile::kLan);
  return member;
}

Membership::~Membership() {
  if (presence_writer_) static_cast<void>(presence_writer_->dispose(presence_));
}

/// The announcement of the wanted session, as soon as a server that this program can speak with makes it.
Result<SessionAnnounce> Membership::await(const Stop& stop, const std::function<void()>& meanwhile) {
  auto reader = Reader<SessionAnnounce>::open(*lobby_, kSessionAnnounce);
  if (!reader) return fail(reader.error().what);
  SessionAnnounce announce;
  const bool found = waitFor(wishes_.patience, stop, meanwhile, [&] {
    while (reader->take(announce))
      if (wishes_.session.empty() || announce.session == wishes_.session) return true;
    return false;
  });
  if (!found && stop) return fail("stopped while looking for " + named(wishes_.session));
  if (!found) {
    return fail("no server announced " + named(wishes_.session) + " on domain " +
                std::to_string(wishes_.domain) + " within " + std::to_string(wishes_.patience.count()) +
                " s: start one with `tenon serve`");
  }
  if (announce.protocol_version != kProtocolVersion) {
    return fail("the server speaks protocol " + std::to_string(announce.protocol_version) +
                ", this program " + std::to_string(kProtocolVersion) + ": update the older of the two");
  }
  if (wishes_.lockstep && !announce.lockstep) {
    return fail("session '" + announce.session +
                "' does not run in lockstep: start the server with --lockstep, or leave it out here");
  }
  return announce;
}

Result<void> Membership::join(const Stop& stop, const std::function<void()>& meanwhile) {
  auto joins = Writer<Join>::open(*lobby_, kJoin);
  if (!joins) return fail(joins.error().what);
  auto welcomes = Reader<Welcome>::open(*lobby_, kWelcome);
  if (!welcomes) return fail(welcomes.error().what);
  const Join join{guid_, wishes_.person, wishes_.role, wishes_.hands, wishes_.token, kProtocolVersion};
  Result<void> asked;
  auto ask_at = std::chrono::steady_clock::now();
  const bool answered = waitFor(wishes_.patience, stop, meanwhile, [&] {
    if (std::chrono::steady_clock::now() >= ask_at && joins->matchedReaders() > 0 &&
        welcomes->matchedWriters() > 0) {
      asked = joins->write(join);
      ask_at = std::chrono::steady_clock::now() + kAskAgain;
    }
    // a refusal that names a client is about the seat that was lost, not about this question
    while (asked && welcomes->take(welcome_, &server_))
      if (welcome_.client_guid == guid_ && (welcome_.accepted || !welcome_.client.valid())) return true;
    return !asked;
  });
  if (!asked) return asked;
  if (!answered && stop) return fail("stopped while joining " + named(announce_.session));
  if (!answered)
    return fail("the server of " + named(announce_.session) +
                " does not answer: it may be hung or just gone");
  if (!welcome_.accepted)
    return fail("the server of " + named(announce_.session) + " refuses: " + welcome_.reason);
  return takeSeat();
}

Result<void> Membership::takeSeat() {
  wishes_.token = welcome_.token;
  lost_.reset();
  server_gone_ = false;
  presence_ = {welcome_.client, wishes_.person, wishes_.role, {}, true};
  for (const HandId hand : welcome_.hands)
    if (hand.valid()) presence_.hands.push_back(hand);
  if (!presence_writer_) {
    auto writer = Writer<Presence>::open(*session_, kPresence);
    if (!writer) return fail(writer.error().what);
    presence_writer_ = std::make_unique<Writer<Presence>>(std::move(*writer));
  }
  return presence_writer_->write(presence_);
}

Result<void> Membership::watch(Inbox& inbox) {
  auto watched =
      inbox.onGone<SessionAnnounce>(*lobby_, kSessionAnnounce, [this](const SessionAnnounce& gone) {
        if (gone.session != announce_.session) return;
        server_gone_ = true;
        lost_ = "the server of " + named(announce_.session) + " is gone";
      });
  if (!watched) return watched;
  return inbox.on<Welcome>(*lobby_, kWelcome, [this](const Welcome& word) {
    if (word.client_guid != guid_ || word.client != welcome_.client) return;
    if (word.accepted) return lost_.reset();
    lost_ = "the server of " + named(announce_.session) + " took this program out: " + word.reason;
  });
}

Result<void> Membership::comeBack(const Stop& stop, const std::function<void()>& meanwhile) {
  const bool was_lockstep = announce_.lockstep;
  auto announce = await(stop, meanwhile);
  if (!announce) return fail(announce.error().what);
  announce_ = std::move(*announce);
  if (announce_.lockstep != was_lockstep)
    return fail(named(announce_.session) + " has changed its pace: start this program again");
  return join(stop, meanwhile);
}

}  // namespace tenon
