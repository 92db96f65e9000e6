#include "clients/command/command_program.h"

#include <cassert>
#include <cstdio>
#include <utility>

#include <fmt/format.h>

#include "clients/command/stop_raiser.h"
#include "idl/types/messages/steps.h"
#include "idl/types/printable_text.h"

namespace tenon::command {

namespace {

using std::chrono::milliseconds;
constexpr std::chrono::seconds kPatience{5};   // for an answer
constexpr milliseconds kBetweenTellings{500};  // of raises of the emergency stop
constexpr milliseconds kForRaises{1000};       // to hear of the raises of the emergency stop
constexpr milliseconds kResend{500};           // an answer sent before our reader was matched is lost

/// Twice is as good as once.
bool isRepeatable(CommandKind kind) {
  return kind == CommandKind::kKick || kind == CommandKind::kStop || kind == CommandKind::kFreezeForces ||
         kind == CommandKind::kSetCollision;
}

}  // namespace

std::string describe(const NewestRaise& newest) {
  return fmt::format("emergency stop by {}: {}{}", printable(newest.who), printable(newest.reason),
                     newest.standing > 1 ? fmt::format(", the newest of {} raises", newest.standing) : "");
}

/// False when that does not happen in time.
bool CommandClient::dispatchUntil(const Stop& stop, std::chrono::steady_clock::duration timeout,
                                  const std::function<bool()>& done) {
  const auto until = std::chrono::steady_clock::now() + timeout;
  while (!done()) {
    if (stop || std::chrono::steady_clock::now() >= until) return false;
    if (meanwhile_) meanwhile_();
    inbox_.dispatch(milliseconds(20));
    tellNewest();
  }
  return true;
}

Result<std::unique_ptr<CommandClient>> CommandClient::open(wire::MembershipOptions options, const Stop& stop,
                                                           std::function<void()> meanwhile) {
  options.passive = true;
  std::unique_ptr<CommandClient> client(new CommandClient(std::move(options), std::move(meanwhile)));
  if (auto connected = client->connect(stop); !connected) return fail(connected.error().what);
  return client;
}

Result<void> CommandClient::connect(const Stop& stop) {
  auto found = wire::Membership::find(options_, stop, meanwhile_);
  if (!found) return fail(found.error().what);
  member_ = std::move(*found);
  if (auto joined = member_->join(stop, meanwhile_); !joined) return joined;
  wire::Partition& session = member_->session();
  Result<void> all = member_->watch(inbox_);
  if (all) all = openInto(commands_, session, wire::kCommand);
  if (all) {
    all = inbox_.on<CommandAck>(session, wire::kCommandAck, [this](const CommandAck& ack) {
      if (ack.client == member_->welcome().client) ack_ = ack;
    });
  }
  if (all) {
    all = inbox_.on<StepState>(session, wire::kStepState, [this](const StepState& step) {
      if (step.phase != StepPhase::kActive || step.name == step_) return;
      step_ = step.name;
      if (report)
        report("step " + std::to_string(step.step + 1) + "/" + std::to_string(step.steps) + ": " + step_);
    });
  }
  if (all) all = inbox_.on<RunState>(session, wire::kRunState, [this](const RunState& run) { receive(run); });
  if (all) {
    all = inbox_.on<NewestRaise>(session, wire::kNewestRaise,
                                 [this](const NewestRaise& newest) { receive(newest); });
  }
  return all ? awaitReader(stop) : all;
}

Result<void> CommandClient::awaitReader(const Stop& stop) {
  const bool matched = dispatchUntil(stop, kPatience, [this] {
    return commands_->matchedReaders() > 0 && inbox_.matchedWriters() > 1 && member_->isWatching();
  });
  if (!matched) return fail("the server of session '" + member_->sessionName() + "' does not read commands");
  return {};
}

void CommandClient::receive(const RunState& run) {
  if (report && (!run_ || run.reason != run_->reason)) report("session: " + run.reason);
  run_ = run;
}

void CommandClient::receive(const NewestRaise& newest) {
  newest_ = newest;
  tellNewest();
}

/// Of many raises at a rate that a person can read.
void CommandClient::tellNewest() {
  if (!newest_ || told_ == newest_->number) return;
  if (newest_->standing > 0) {
    if (!report_raise) return;
    const auto now = std::chrono::steady_clock::now();
    if (now < next_telling_) return;
    next_telling_ = now + kBetweenTellings;
    report_raise(describe(*newest_));
  }
  told_ = newest_->number;
}

Result<void> CommandClient::send(const ParsedCommand& command, const Stop& stop) {
  assert(command.command);
  if (lost()) return fail(*lost());
  auto sent = sendOnce(command, stop);
  if (sent || !member_->serverIsGone()) return sent;
  if (!isRepeatable(*command.command))
    return fail(*lost() +
                " before it has answered, so it may have obeyed or not: look at the session that is resumed "
                "(tenon command list), and repeat the command if it has not");
  if (auto back = rejoin(stop); !back) return fail("the server has not answered; " + back.error().what);
  return sendOnce(command, stop);
}

Result<void> CommandClient::rejoin(const Stop& stop) {
  newest_.reset();  // of the server that has ended
  told_ = 0;
  auto back = member_->rejoin(stop, meanwhile_);
  return back ? awaitReader(stop) : back;
}

Result<void> CommandClient::sendOnce(const ParsedCommand& command, const Stop& stop) {
  ack_.reset();
  const bool is_clear = command.command == CommandKind::kClearEmergencyStop;
  if (is_clear && !command.value) {
    (void)dispatchUntil(stop, kForRaises, [this] { return newest_.has_value(); });
    next_telling_ = {};  // what it names is told, whatever was told before
    tellNewest();
  }
  const double value = command.value.value_or(is_clear && newest_ ? newest_->number : 0.0);
  const Command message{member_->welcome().client, ++sent_, *command.command, {}, command.text, value};
  const auto until = std::chrono::steady_clock::now() + kPatience;
  const auto answered = [&] { return ack_ && ack_->id == message.id; };
  do {
    if (stop) return fail("its answer is not awaited any more: the server may obey or not");
    if (std::chrono::steady_clock::now() >= until)
      return fail("no answer from the server: it may hang or have ended");
    if (auto sent = commands_->write(message); !sent) return sent;
    (void)dispatchUntil(stop, kResend, [&] { return answered() || lost(); });
    if (!answered() && lost()) return fail(*lost());
  } while (!answered());
  if (!ack_->accepted) return fail("refused: " + printable(ack_->reason));
  return {};
}

int emergencyOnce(const wire::MembershipOptions& options, const ParsedCommand& command,
                  const RaisePatience& patience, const std::atomic<bool>& stop) {
  // as servers and stations, which may leave an overloaded machine no time for others; where it is permitted
  static_cast<void>(wire::raiseWireThreads());
  auto raiser = StopRaiser::open(options.domain, options.session, options.person);
  static_cast<void>(wire::raiseWireThreads());  // of DDS, which has begun
  const auto textOf = [&options](const StopHeard& heard) {
    const auto outcome = outcomeOf(heard, options.domain, options.session);
    return outcome ? *outcome : outcome.error().what;
  };
  const auto tell = [&textOf](const StopHeard& heard) {
    std::fprintf(stderr,
                 "emergency: not confirmed yet: %s; it is repeated until it is confirmed, Ctrl-C ends that; "
                 "use the devices' own switches\n",
                 textOf(heard).c_str());
  };
  const std::string reason = command.text.empty() ? "requested" : command.text;
  const auto heard = raiser ? (*raiser)->raise(reason, patience, stop, tell) : fail(raiser.error().what);
  if (!heard) {
    std::fprintf(stderr, "tenon command: %s\n", heard.error().what.c_str());
    return 1;
  }
  if (heard->isConfirmed() || heard->isObeyedWithoutServer()) {
    std::printf("emergency: %s\n", textOf(*heard).c_str());
    return 0;
  }
  std::fprintf(stderr, "tenon command: %s\n", textOf(*heard).c_str());
  return 1;
}

}  // namespace tenon::command
