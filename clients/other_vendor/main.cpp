/// Takes part in a session of Tenon by its protocol alone, idl/tenon.idl, with Fast DDS:
///
///   tenon-other-vendor [--domain D] [--session NAME] [--role trainee|observer] [--seconds S]
///                      [--note TEXT | --pause]
///
/// Finds a session on this machine, joins it, sends one command, reads frames and manifolds for some seconds
/// and prints what it has got as JSON. Exit code: 0, also when the command was refused, with the reason in
/// the JSON; 1 when there is no session or it does not let this program in; 2 for wrong usage.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <optional>
#include <random>

#include <tenonPubSubTypes.h>

#include "clients/other_vendor/bus.h"

namespace tenon::other_vendor {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;
constexpr milliseconds kTimeout{10000};  ///< for finding a session, and for its answers
constexpr milliseconds kRepeat{500};     ///< a request that is not answered is sent again
constexpr std::uint32_t kInvalid = 0xFFFFFFFF;

struct OtherVendorOptions {
  std::uint32_t domain = 0;
  std::string session;  ///< empty: the first one announced
  Role role = ROLE_OBSERVER;
  milliseconds listen{3000};
  std::optional<CommandKind> command;
  std::string text;  ///< of the command
};

/// What a session has sent.
struct Heard {
  std::uint64_t frames = 0;  ///< samples of WorldFrame: a tick of a large scene has several parts
  std::uint64_t first_tick = 0, last_tick = 0;
  bool in_order = true;  ///< no frame was older than the one before it
  std::map<std::uint32_t, ObjectState> objects;
  std::uint64_t manifolds = 0;
  std::map<std::uint32_t, HandManifold> hands;
};

/// The client's way through a session.
class OtherClient {
 public:
  explicit OtherClient(const OtherVendorOptions& options)
      : options_(options), bus_(options.domain), lobby_(bus_.partition("lobby")) {}

  /// Waits for the announcement of the session. Its writer is the server; what others write in its name is
  /// not taken from then on.
  void find() {
    BusReader<SessionAnnouncePubSubType> announcements(bus_, lobby_, "SessionAnnounce", TopicClass::kState);
    waitFor("no session was announced in this domain", [&] {
      announcements.take([&](const SessionAnnounce& found, const SampleOrigin& from) {
        if (!options_.session.empty() && found.session() != options_.session) return;
        announce_ = found;
        server_ = from;
      });
      return !announce_.session().empty();
    });
    if (announce_.protocol_version() != TENON_PROTOCOL_VERSION)
      throw std::runtime_error("the server has protocol version " +
                               std::to_string(announce_.protocol_version()) + ", this program " +
                               std::to_string(TENON_PROTOCOL_VERSION));
  }

  /// Asks for a seat until the server answers, then says that it is there.
  void join() {
    BusWriter<JoinPubSubType> joins(bus_, lobby_, "Join", TopicClass::kEvent,
                                    {.lifespan = milliseconds(5000)});
    BusReader<WelcomePubSubType> welcomes(bus_, lobby_, "Welcome", TopicClass::kEvent);
    Join request;
    std::random_device random;
    request.client_guid(std::to_string(random()) + std::to_string(random()));
    request.session(announce_.session());
    request.server_epoch(announce_.server_epoch());
    request.name("another vendor");
    request.role(options_.role);
    request.protocol_version(TENON_PROTOCOL_VERSION);  // no hands, and no key: the seat is not kept
    auto next = steady_clock::now();
    waitFor("the server does not answer the request to join", [&] {
      if (steady_clock::now() >= next && joins.isMatched() && welcomes.isMatched()) {
        joins.write(request);
        next = steady_clock::now() + kRepeat;
      }
      bool is_answered = false;
      welcomes.take([&](const Welcome& answer, const SampleOrigin& from) {
        if (from != server_ || answer.client_guid() != request.client_guid()) return;
        welcome_ = answer;
        is_answered = true;
      });
      return is_answered;
    });
    if (!welcome_.challenge().to_string().empty())
      throw std::runtime_error(
          "the server asks for a proof of its key, which this program has not: idl/wire/identity.h");
    if (!welcome_.accepted())
      throw std::runtime_error("the server refuses: " + welcome_.reason().to_string());
    session_ = bus_.partition("s/" + announce_.session());
    hands_ = bus_.partition("s/" + announce_.session() + "/hand/*");  // each hand has its own
    presence_.emplace(bus_, session_, "Presence", TopicClass::kState,
                      WriterLimits{.lease = milliseconds(2000)});
    present_.client_id(welcome_.client_id());
    present_.name(request.name());
    present_.role(options_.role);
    present_.alive(true);
    presence_->write(present_);
  }

  /// Sends the command, if one is wanted, and hears the session for a while.
  void take_part() {
    BusReader<WorldFramePubSubType> frames(bus_, session_, "WorldFrame_100", TopicClass::kStream);
    BusReader<HandManifoldPubSubType> manifolds(bus_, hands_, "HandManifold", TopicClass::kStream);
    BusReader<CommandAckPubSubType> acks(bus_, session_, "CommandAck", TopicClass::kEvent);
    BusWriter<CommandPubSubType> commands(bus_, session_, "Command", TopicClass::kEvent,
                                          {.lifespan = milliseconds(5000)});
    const auto until = steady_clock::now() + options_.listen;
    const auto answered_until = steady_clock::now() + kTimeout;
    auto next = steady_clock::now();
    const auto is_waiting = [&] { return options_.command && !ack_; };
    while (steady_clock::now() < until || is_waiting()) {
      if (is_waiting() && steady_clock::now() >= answered_until)
        throw std::runtime_error("the server does not answer the command");
      if (is_waiting() && steady_clock::now() >= next && commands.isMatched() && acks.isMatched()) {
        send(commands);
        next = steady_clock::now() + kRepeat;
      }
      bus_.wait(milliseconds(50));
      frames.take([&](const WorldFrame& frame, const SampleOrigin& from) { hear(frame, from); });
      manifolds.take([&](const HandManifold& manifold, const SampleOrigin& from) { hear(manifold, from); });
      acks.take([&](const CommandAck& ack, const SampleOrigin& from) {
        if (from == server_ && ack.client_id() == welcome_.client_id() && ack.id() == 1) ack_ = ack;
      });
    }
  }

  /// So that the server need not wait for the end of the lease.
  void leave() { presence_->dispose(present_); }

  void print() const;

 private:
  template <class Done>
  void waitFor(const char* problem, Done done) {
    const auto until = steady_clock::now() + kTimeout;
    while (!done()) {
      if (steady_clock::now() >= until) throw std::runtime_error(problem);
      bus_.wait(milliseconds(50));
    }
  }

  /// A repeated command has the same id: it takes effect once.
  void send(BusWriter<CommandPubSubType>& commands) const {
    Command command;
    command.client_id(welcome_.client_id());
    command.id(1);
    command.kind(*options_.command);
    command.hand_id(kInvalid);
    command.text(options_.text);
    commands.write(command);
  }

  void hear(const WorldFrame& frame, const SampleOrigin& from) {
    if (from != server_) return;
    if (heard_.frames++ == 0) heard_.first_tick = heard_.last_tick = frame.tick();
    heard_.in_order = heard_.in_order && frame.tick() >= heard_.last_tick;
    heard_.last_tick = frame.tick();
    for (const ObjectState& state : frame.states()) heard_.objects[state.object_id()] = state;
  }

  void hear(const HandManifold& manifold, const SampleOrigin& from) {
    if (from != server_) return;
    ++heard_.manifolds;
    heard_.hands[manifold.hand_id()] = manifold;
  }

  OtherVendorOptions options_;
  Bus bus_;
  BusPartition lobby_, session_, hands_;
  SessionAnnounce announce_;
  SampleOrigin server_;
  Welcome welcome_;
  std::optional<BusWriter<PresencePubSubType>> presence_;
  Presence present_;
  Heard heard_;
  std::optional<CommandAck> ack_;
};

std::string quoted(const std::string& text) {
  std::string json = "\"";
  for (const char letter : text) {
    if (letter == '"' || letter == '\\') json += '\\';
    json += static_cast<unsigned char>(letter) < 0x20 ? ' ' : letter;
  }
  return json + "\"";
}

void printPose(const Pose& X_WB) {
  const auto& p = X_WB.p();
  const auto& q = X_WB.q();
  std::printf("\"p\": [%.9g, %.9g, %.9g], \"q\": [%.9g, %.9g, %.9g, %.9g]", p[0], p[1], p[2], q[0], q[1],
              q[2], q[3]);
}

void OtherClient::print() const {
  std::printf("{\"session\": %s, \"scenario\": %s, \"client\": %u,\n", quoted(announce_.session()).c_str(),
              quoted(announce_.scenario().to_string()).c_str(), welcome_.client_id());
  std::printf(
      " \"frames\": {\"count\": %llu, \"first_tick\": %llu, \"last_tick\": %llu, \"in_order\": %s},\n",
      static_cast<unsigned long long>(heard_.frames), static_cast<unsigned long long>(heard_.first_tick),
      static_cast<unsigned long long>(heard_.last_tick), heard_.in_order ? "true" : "false");
  std::printf(" \"objects\": [");
  const char* before = "\n";
  for (const auto& [id, state] : heard_.objects) {
    std::printf("%s  {\"object\": %u, \"status\": %u, \"holder\": %u, ", before, id,
                static_cast<unsigned>(state.status()), state.holder());
    printPose(state.X_WO());
    std::printf("}");
    before = ",\n";
  }
  std::printf("],\n \"manifolds\": {\"count\": %llu, \"hands\": [",
              static_cast<unsigned long long>(heard_.manifolds));
  before = "\n";
  for (const auto& [id, manifold] : heard_.hands) {
    std::printf("%s  {\"hand\": %u, \"object\": %u, \"tick\": %llu, \"contacts\": %zu, ", before, id,
                manifold.object_id(), static_cast<unsigned long long>(manifold.tick()),
                manifold.contacts().size());
    printPose(manifold.X_WO());
    std::printf("}");
    before = ",\n";
  }
  std::printf("]}");
  if (ack_)
    std::printf(",\n \"command\": {\"accepted\": %s, \"reason\": %s}", ack_->accepted() ? "true" : "false",
                quoted(ack_->reason().to_string()).c_str());
  std::printf("}\n");
}

/// None for an argument that there is not.
std::optional<OtherVendorOptions> read(int count, char** arguments) {
  OtherVendorOptions options;
  for (int i = 1; i < count; ++i) {
    const std::string name = arguments[i];
    if (name == "--pause") {
      options.command = COMMAND_PAUSE;
      continue;
    }
    if (++i == count) return std::nullopt;
    const std::string value = arguments[i];
    if (name == "--domain") {
      options.domain = static_cast<std::uint32_t>(std::atoi(value.c_str()));
    } else if (name == "--session") {
      options.session = value;
    } else if (name == "--seconds") {
      options.listen = milliseconds(static_cast<long>(1000.0 * std::atof(value.c_str())));
    } else if (name == "--role" && (value == "trainee" || value == "observer")) {
      options.role = value == "trainee" ? ROLE_TRAINEE : ROLE_OBSERVER;
    } else if (name == "--note") {
      options.command = COMMAND_NOTE;
      options.text = value;
    } else {
      return std::nullopt;
    }
  }
  return options;
}

}  // namespace
}  // namespace tenon::other_vendor

int main(int count, char** arguments) {
  using namespace tenon::other_vendor;
  const auto options = read(count, arguments);
  if (!options) {
    std::fprintf(stderr,
                 "usage: tenon-other-vendor [--domain D] [--session NAME] [--role trainee|observer] "
                 "[--seconds S] [--note TEXT | --pause]\n");
    return 2;
  }
  try {
    OtherClient client(*options);
    client.find();
    client.join();
    client.take_part();
    client.leave();
    client.print();
    return 0;
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "tenon-other-vendor: %s\n", problem.what());
    return 1;
  }
}
