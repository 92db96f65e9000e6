#include "idl/wire/membership.h"

#include <cstdio>
#include <optional>
#include <random>
#include <thread>
#include <utility>

#include "idl/wire/network.h"

namespace tenon::wire {
namespace {

using std::chrono::milliseconds;
constexpr milliseconds kRepeatInterval{500};
constexpr milliseconds kPollInterval{5};
// a server that is alive answers within the lease of its announcement
constexpr milliseconds kLapse = kSessionAnnounce.parameters.lease;
constexpr milliseconds kOthersWait{100};  // after the first announcement, for an earlier server of that name

std::string randomGuid() {
  std::random_device source;
  char text[24];
  std::snprintf(text, sizeof text, "%08x%08x", source(), source());
  return text;
}

std::string sessionText(const std::string& session) {
  return session.empty() ? "a session" : "session '" + session + "'";
}

/// Where and with what remedy no server was found: the network decides it.
std::string notFoundText(const MembershipOptions& options) {
  const std::string within = " within " + std::to_string(options.timeout.count()) + " s: ";
  const auto network = chosenNetwork();
  if (!network || network->reach == Reach::kConfig)
    return " by CYCLONEDDS_URI" + within + "start one with `tenon serve`, by the same configuration";
  const std::string where = " on the network '" + network->text + "'" + within;
  if (network->reach == Reach::kLoopback)
    return where + "start one with `tenon serve`; one on another machine: choose its network (--network)";
  std::string peers;
  for (const std::string& peer : network->peers) peers += (peers.empty() ? "" : " and ") + peer;
  return where + (peers.empty() ? "no peers are named" : "is it at " + peers) +
         (peers.empty() ? "; start one with `tenon serve --network "
                        : "? Start one there with `tenon serve --network ") +
         (network->reach == Reach::kWan ? "wan" : "lan") + "`, or check the link with `tenon doctor --peer " +
         (network->peers.empty() ? "HOST" : network->peers.front()) + "`";
}

/// Polls `done`; false when it is not true within `timeout` or `stop` is set.
template <class Done>
bool waitFor(std::chrono::seconds timeout, const std::atomic<bool>& stop,
             const std::function<void()>& meanwhile, Done done) {
  const auto until = std::chrono::steady_clock::now() + timeout;
  while (!done()) {
    if (stop || std::chrono::steady_clock::now() >= until) return false;
    if (meanwhile) meanwhile();
    std::this_thread::sleep_for(kPollInterval);
  }
  return true;
}

}  // namespace

Result<std::unique_ptr<Membership>> Membership::find(const MembershipOptions& options, const Stop& stop,
                                                     const std::function<void()>& meanwhile) {
  auto participant =
      Participant::open({.domain = options.domain,
                         .profile = options.lockstep ? LinkProfile::kLockstep : LinkProfile::kLan,
                         .config = {}});
  if (!participant) return fail(participant.error().what);
  std::unique_ptr<Membership> member(new Membership(options));
  member->participant_ = *participant;
  if (!member->options_.seat) member->options_.seat = SeatKey::random();
  member->lobby_ = std::make_unique<Partition>(*participant, kLobby, LinkProfile::kLan);
  auto announce = member->awaitAnnounce(stop, meanwhile);
  if (!announce) return fail(announce.error().what);
  member->announce_ = std::move(*announce);
  member->options_.session = member->announce_.session;
  const bool lockstep = member->announce_.lockstep && !options.passive;
  member->session_ = std::make_unique<Partition>(*participant, sessionPartition(member->announce_.session),
                                                 lockstep ? LinkProfile::kLockstep : LinkProfile::kLan);
  member->own_ = std::make_unique<Partition>(
      *participant, clientPartition(member->announce_.session, (*participant)->origin()),
      member->session_->profile());
  member->everything_ =
      std::make_unique<Partition>(*participant, sessionPartition(member->announce_.session),
                                  member->session_->profile(), handPartitions(member->announce_.session));
  member->hearServer();
  return member;
}

Membership::~Membership() { leave(); }

void Membership::leave() {
  if (presence_writer_ && std::exchange(presence_.alive, false))
    static_cast<void>(presence_writer_->dispose(presence_));
}

/// Waits for the announcement of the session; fails when the server's protocol or pace does not fit.
Result<SessionAnnounce> Membership::awaitAnnounce(const Stop& stop, const std::function<void()>& meanwhile) {
  auto reader = Reader<SessionAnnounce>::open(*lobby_, kSessionAnnounce);
  if (!reader) return fail(reader.error().what);
  SessionAnnounce announce, next;
  Origin from;
  std::optional<std::chrono::steady_clock::time_point> found_at;
  (void)waitFor(options_.timeout, stop, meanwhile, [&] {
    while (reader->take(next, &from)) {
      const std::string& wanted = found_at ? announce.session : options_.session;
      if (!from.known() || (!wanted.empty() && next.session != wanted)) continue;
      if (found_at && next.server_epoch >= announce.server_epoch) continue;
      announce = next;
      server_ = from;
      if (!found_at) found_at = std::chrono::steady_clock::now();
    }
    return found_at && std::chrono::steady_clock::now() - *found_at >= kOthersWait;
  });
  const bool found = found_at.has_value();
  if (found) lobby_->hearOnly(server_);
  if (!found && stop) return fail("stopped while looking for " + sessionText(options_.session));
  if (!found) {
    return fail("no server announced " + sessionText(options_.session) + " on domain " +
                std::to_string(options_.domain) + notFoundText(options_));
  }
  if (announce.protocol_version != kProtocolVersion) {
    return fail("the server has protocol version " + std::to_string(announce.protocol_version) +
                ", this program " + std::to_string(kProtocolVersion) + ": update the older of the two");
  }
  if (options_.lockstep && !announce.lockstep) {
    return fail("session '" + announce.session +
                "' does not run in lockstep: start the server with --lockstep, or omit it here");
  }
  return announce;
}

Result<void> Membership::join(const Stop& stop, const std::function<void()>& meanwhile) {
  return requestSeat(stop, meanwhile, nullptr);
}

Result<void> Membership::requestSeat(const Stop& stop, const std::function<void()>& meanwhile, bool* ended) {
  auto joins = Writer<Join>::open(*lobby_, kJoin);
  if (!joins) return fail(joins.error().what);
  auto welcomes = Reader<Welcome>::open(*lobby_, kWelcome);
  if (!welcomes) return fail(welcomes.error().what);
  guid_ = randomGuid();
  Join join{.client_guid = guid_,
            .session = announce_.session,
            .server_epoch = announce_.server_epoch,
            .name = options_.person,
            .role = options_.role,
            .hands = options_.hands,
            .seat_key = options_.seat->publicKey(),
            .stiffness = options_.stiffness,
            .recorded_until = options_.recorded_until ? options_.recorded_until(announce_) : 0};
  // heard of every server of this session, unlike by the readers of lobby()
  Partition everybody(participant_, kLobby, LinkProfile::kLan);
  Inbox servers;
  bool gone = false, has_successor = false;
  auto watched = servers.on<SessionAnnounce>(everybody, kSessionAnnounce, [&](const SessionAnnounce& other) {
    if (other.session == announce_.session && other.server_epoch > announce_.server_epoch)
      has_successor = true;
  });
  if (watched)
    watched = servers.onGone<SessionAnnounce>(everybody, kSessionAnnounce, [&](const SessionAnnounce& other) {
      if (other.session == announce_.session && other.server_epoch == announce_.server_epoch) gone = true;
    });
  if (!watched) return watched;
  const auto asked_at = std::chrono::steady_clock::now();
  std::string key_problem;
  Result<void> sent;
  auto send_at = std::chrono::steady_clock::now();
  const bool answered = waitFor(options_.timeout, stop, meanwhile, [&] {
    if (std::chrono::steady_clock::now() >= send_at && joins->matchedReaders() > 0 &&
        welcomes->matchedWriters() > 0) {
      sent = joins->write(join);
      send_at = std::chrono::steady_clock::now() + kRepeatInterval;
    }
    while (sent && welcomes->take(welcome_)) {
      if (welcome_.client_guid != guid_ || welcome_.server_epoch != announce_.server_epoch) continue;
      if (!welcome_.challenge.empty()) {
        if (!join.seat_proof.empty()) continue;  // challenged again by a request on its way
        prove(welcome_.challenge, join, key_problem);
        sent = joins->write(join);
        continue;
      }
      // a refusal with a valid client id is the notice of a lost seat, not the answer to this request
      if (welcome_.accepted || !welcome_.client.valid()) return true;
    }
    servers.dispatch(std::chrono::nanoseconds(0));
    // a server that is alive and was first is the session's, whoever else announces it
    if (ended != nullptr)
      *ended = gone || (has_successor && std::chrono::steady_clock::now() - asked_at > kLapse);
    return !sent || (ended != nullptr && *ended);
  });
  if (!sent) return sent;
  if (ended != nullptr && *ended)
    return fail("the server of " + sessionText(announce_.session) + " has ended");
  if (!answered && stop) return fail("stopped while joining " + sessionText(announce_.session));
  if (!answered)
    return fail("the server of " + sessionText(announce_.session) +
                " does not answer: it may hang or have ended");
  if (!welcome_.accepted)
    return fail("the server of " + sessionText(announce_.session) + " refuses: " + welcome_.reason +
                (key_problem.empty() ? "" : "; " + key_problem));
  return takeSeat();
}

void Membership::prove(const std::string& challenge, Join& join, std::string& problem) const {
  const ProofSubject subject{.challenge = challenge,
                             .session = join.session,
                             .server_epoch = join.server_epoch,
                             .client_guid = join.client_guid,
                             .role = join.role,
                             .client = participant_->origin()};
  join.seat_proof = options_.seat->proofOf(subject);
  const auto file = options_.key_file.empty() ? defaultKeyFile() : options_.key_file;
  const auto key = options_.key ? Result<SharedKey>(*options_.key) : readKeyFile(file);
  if (key) join.key_proof = key->proofOf(subject);
  if (!key) problem = key.error().what;
}

void Membership::hearServer() {
  session_->hearOnly(server_);
  own_->hearOnly(server_);
  everything_->hearOnly(server_);
  for (Partition& hand : hands_) hand.hearOnly(server_);
}

/// A seat has the same hands in each life of the server, so the readers stay.
void Membership::openHands() {
  if (!hands_.empty()) return;
  for (const HandId hand : presence_.hands) {
    hands_.emplace_back(participant_, handPartition(announce_.session, hand), session_->profile());
    hands_.back().hearOnly(server_);
  }
}

Result<void> Membership::takeSeat() {
  lost_.reset();
  server_gone_ = false;
  unheard_since_.reset();
  presence_ = {welcome_.client, options_.person, options_.role, {}, true};
  for (const HandId hand : welcome_.hands)
    if (hand.valid()) presence_.hands.push_back(hand);
  openHands();
  if (!presence_writer_)
    if (auto opened = openInto(presence_writer_, *session_, kPresence); !opened) return opened;
  return presence_writer_->write(presence_);
}

Result<void> Membership::watch(Inbox& inbox) {
  auto watched =
      inbox.on<SessionAnnounce>(*lobby_, kSessionAnnounce, [this](const SessionAnnounce& announced) {
        if (announced.session == announce_.session) watched_epoch_ = announced.server_epoch;
      });
  if (!watched) return watched;
  watched = inbox.onGone<SessionAnnounce>(*lobby_, kSessionAnnounce, [this](const SessionAnnounce& gone) {
    if (gone.session != announce_.session || gone.server_epoch != announce_.server_epoch) return;
    loseServer();
  });
  if (!watched) return watched;
  watches_ = true;
  return inbox.on<Welcome>(*lobby_, kWelcome, [this](const Welcome& notice) {
    // a challenge or refusal, which names no seat, is for who asks
    if (!notice.client.valid() || notice.client_guid != guid_ || notice.client != welcome_.client) return;
    if (notice.accepted) return lost_.reset();
    is_displaced_ = notice.reason == kSeatTaken;
    lost_ = "the server of " + sessionText(announce_.session) + " removed this client: " + notice.reason;
    leave();
  });
}

void Membership::loseServer() {
  server_gone_ = true;
  lost_ = "the server of " + sessionText(announce_.session) + " is gone";
}

const std::optional<std::string>& Membership::lost() {
  if (lost_ || !watches_ || isWatching()) {
    unheard_since_.reset();
    return lost_;
  }
  const auto now = std::chrono::steady_clock::now();
  if (!unheard_since_) unheard_since_ = now;
  if (now - *unheard_since_ > 2 * kLapse) loseServer();
  return lost_;
}

Result<void> Membership::rejoin(const Stop& stop, const std::function<void()>& meanwhile) {
  if (is_displaced_) return fail("this one ends");
  const SessionAnnounce before = announce_;
  const auto until = std::chrono::steady_clock::now() + options_.timeout;
  while (true) {
    bool ended = false;
    const auto back = rejoinNext(before, stop, meanwhile, ended);
    if (!back && !ended) leave();
    if (back || !ended || std::chrono::steady_clock::now() >= until) return back;
  }
}

/// As rejoin(), of the server that is announced now.
Result<void> Membership::rejoinNext(const SessionAnnounce& before, const Stop& stop,
                                    const std::function<void()>& meanwhile, bool& ended) {
  auto announce = awaitAnnounce(stop, meanwhile);
  if (!announce) return fail(announce.error().what);
  announce_ = std::move(*announce);
  if (announce_.scenario_hash != before.scenario_hash || announce_.scene_hash != before.scene_hash)
    return fail(sessionText(announce_.session) + " runs another scenario now: start this program again");
  hearServer();
  if (announce_.lockstep != before.lockstep)
    return fail(sessionText(announce_.session) +
                " changed between lockstep and real time: start this program again");
  return requestSeat(stop, meanwhile, &ended);
}

}  // namespace tenon::wire
