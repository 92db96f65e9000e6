#include "clients/tell/tell_program.h"

#include <utility>

namespace tenon {

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;
constexpr std::chrono::seconds kPatience{5};  // for an answer
constexpr milliseconds kAskAgain{500};        // an answer that came before anybody could hear it is lost

template <class M>
Result<void> openWriter(std::unique_ptr<Writer<M>>& writer, Partition& partition, const Topic<M>& topic) {
  auto opened = Writer<M>::open(partition, topic);
  if (!opened) return fail(opened.error().what);
  writer = std::make_unique<Writer<M>>(std::move(*opened));
  return {};
}

/// Listens until `done`; false when that does not come in time.
bool heard(Inbox& inbox, const std::atomic<bool>& stop, Clock::duration patience,
           const std::function<bool()>& done) {
  const auto until = Clock::now() + patience;
  while (!done()) {
    if (stop || Clock::now() >= until) return false;
    inbox.dispatch(milliseconds(20));
  }
  return true;
}

}  // namespace

Result<std::unique_ptr<Teller>> Teller::open(MembershipWishes wishes, const Stop& stop) {
  wishes.only_watches = true;
  std::unique_ptr<Teller> teller(new Teller(std::move(wishes)));
  if (auto begun = teller->begin(stop); !begun) return fail(begun.error().what);
  return teller;
}

Result<void> Teller::begin(const Stop& stop) {
  auto found = Membership::find(wishes_, stop);
  if (!found) return fail(found.error().what);
  member_ = std::move(*found);
  if (auto joined = member_->join(stop); !joined) return joined;
  Partition& session = member_->session();
  Result<void> all = member_->watch(inbox_);
  if (all) all = openWriter(commands_, session, kCommand);
  if (all) all = openWriter(stops_, session, kEmergencyStop);
  if (all) {
    all = inbox_.on<CommandAck>(session, kCommandAck, [this](const CommandAck& ack) {
      if (ack.client == member_->welcome().client) ack_ = ack;
    });
  }
  if (all) {
    all = inbox_.onFrom<EmergencyStop>(session, kEmergencyStop,
                                       [this](const EmergencyStop& heard_stop, const Origin& from) {
                                         if (member_->isServer(from)) stopped_ = heard_stop.engaged;
                                       });
  }
  if (all) {
    all = inbox_.on<StepState>(session, kStepState, [this](const StepState& step) {
      if (step.phase != StepPhase::kActive || step.name == step_) return;
      step_ = step.name;
      if (say) say("step " + std::to_string(step.step + 1) + "/" + std::to_string(step.steps) + ": " + step_);
    });
  }
  if (all) all = inbox_.on<RunState>(session, kRunState, [this](const RunState& run) { hear(run); });
  if (!all) return all;
  const bool linked = heard(inbox_, stop, kPatience, [this] {
    return commands_->matchedReaders() > 0 && stops_->matchedReaders() > 0 && inbox_.matchedWriters() > 1;
  });
  if (!linked)
    return fail("the server of session '" + member_->sessionName() + "' does not listen to commands");
  return {};
}

void Teller::hear(const RunState& run) {
  if (say && run.reason != run_.reason) say("the session: " + run.reason);
  run_ = run;
}

bool Teller::listen(milliseconds timeout) {
  inbox_.dispatch(timeout);
  return !member_->lost() && run_.phase < RunPhase::kSucceeded;
}

Result<void> Teller::tell(const Saying& saying, const Stop& stop) {
  if (!saying.command) return stopEverything(saying, stop);
  ack_.reset();
  const Command command{member_->welcome().client, ++said_, *saying.command, {}, saying.text, saying.value};
  const auto until = Clock::now() + kPatience;
  const auto answered = [&] { return ack_ && ack_->id == command.id; };
  do {
    if (stop || Clock::now() >= until) return fail("the server does not answer: it may be hung or just gone");
    if (auto sent = commands_->write(command); !sent) return sent;
  } while (!heard(inbox_, stop, kAskAgain, answered));
  if (!ack_->accepted) return fail("refused: " + ack_->reason);
  return {};
}

/// Goes to every device and to the server at once; that the server says it again is the answer.
Result<void> Teller::stopEverything(const Saying& saying, const Stop& stop) {
  const std::string reason = saying.text.empty() ? "asked for" : saying.text;
  if (auto sent = stops_->write({true, wishes_.person, reason}); !sent) return sent;
  if (!heard(inbox_, stop, kPatience, [this] { return stopped_; }))
    return fail("the server does not answer: the devices were told, the scene may move still");
  return {};
}

}  // namespace tenon
