/// `tenon bench link`: how old a force is, between the processes of a session on this machine, beside a bare
/// DDS ping-pong of the same messages at the same rate in the same run. Idle, and with every core busy.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "idl/types/messages/contacts.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/timing.h"
#include "idl/wire/endpoint.h"
#include "idl/wire/membership.h"

namespace tenon::bench {
namespace {

using BenchTime = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr std::size_t kContacts = 8;  // of a manifold: half of what it may hold
constexpr int kPriority = 75;         // that of a station's loop

struct Options {
  std::filesystem::path programs;
  std::string scenario;
  unsigned seconds = 20;
  std::uint32_t domain = 199;
};

struct Quantiles {
  double p50 = 0.0, p99 = 0.0;  // [s]
};

/// The topics of a ping-pong: as streams, or reliable with all samples kept, which is what DDS's defaults
/// give a writer.
struct PingPongTopics {
  wire::Topic<DeviceInput> input;
  wire::Topic<HandManifold> answer;
};
constexpr PingPongTopics kTuned{{"BenchInput", wire::QosClass::kStream, {}},
                                {"BenchAnswer", wire::QosClass::kStream, {}}};
constexpr PingPongTopics kReliable{{"BenchInputReliable", wire::QosClass::kEvent, {}},
                                   {"BenchAnswerReliable", wire::QosClass::kEvent, {}}};

void useRealTime() {
  const sched_param priority{.sched_priority = kPriority};
  (void)sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &priority);
}

/// Child processes, killed at the end.
class Children {
 public:
  ~Children() {
    for (const pid_t child : pids_) kill(child, SIGKILL);
    for (const pid_t child : pids_) waitpid(child, nullptr, 0);
  }
  Children() = default;
  Children(const Children&) = delete;
  Children& operator=(const Children&) = delete;

  template <class Work>
  void run(Work work) {
    const pid_t child = fork();
    if (child == 0) {
      work();
      _exit(0);
    }
    if (child > 0) pids_.push_back(child);
  }

  void start(std::vector<std::string> words) {
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    pid_t child = 0;
    if (posix_spawn(&child, arguments.front(), &files, nullptr, arguments.data(), environ) == 0)
      pids_.push_back(child);
    posix_spawn_file_actions_destroy(&files);
  }

 private:
  std::vector<pid_t> pids_;
};

Quantiles quantilesOf(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  return {values[values.size() / 2], values[values.size() * 99 / 100]};
}

HandManifold answerTo(const DeviceInput& input) {
  HandManifold answer;
  answer.hand = input.hand;
  answer.answers_seq = input.sample.seq;
  for (std::size_t i = 0; i < kContacts; ++i) answer.contacts.push_back({});
  return answer;
}

/// Answers until it is killed.
void echo(std::uint32_t domain, const PingPongTopics& topics) {
  const auto participant = wire::Participant::open({.domain = domain});
  if (!participant) return;
  wire::Partition partition(*participant, "bench");
  auto writer = wire::Writer<HandManifold>::open(partition, topics.answer);
  wire::Inbox inbox;
  if (!writer || !inbox.on<DeviceInput>(partition, topics.input, [&](const DeviceInput& input) {
        static_cast<void>(writer->write(answerTo(input)));
      }))
    return;
  useRealTime();
  for (;;) inbox.dispatch(milliseconds(100));
}

/// Round trips of `seconds`, once a millisecond.
std::vector<double> pingPong(const Options& options, const PingPongTopics& topics, double seconds) {
  Children children;
  children.run([&] { echo(options.domain, topics); });
  std::vector<double> trips;
  // in a process of its own, as the station's: DDS configures itself once a process
  int pipes[2];
  if (pipe(pipes) != 0) return trips;
  children.run([&] {
    const auto participant = wire::Participant::open({.domain = options.domain});
    if (!participant) return;
    wire::Partition partition(*participant, "bench");
    auto writer = wire::Writer<DeviceInput>::open(partition, topics.input);
    wire::Inbox inbox;
    std::vector<BenchTime::time_point> sent(static_cast<std::size_t>(1000 * seconds) + 1);
    std::vector<double> found;
    if (!writer || !inbox.on<HandManifold>(partition, topics.answer, [&](const HandManifold& answer) {
          if (answer.answers_seq < sent.size())
            found.push_back(
                std::chrono::duration<double>(BenchTime::now() - sent[answer.answers_seq]).count());
        }))
      return;
    while (writer->matchedReaders() == 0 || inbox.matchedWriters() == 0) inbox.dispatch(milliseconds(5));
    useRealTime();
    auto next = BenchTime::now();
    for (std::uint32_t seq = 1; seq < sent.size(); ++seq) {
      DeviceInput input;
      input.hand = HandId{1};
      input.sample.seq = seq;
      sent[seq] = BenchTime::now();
      static_cast<void>(writer->write(input));
      next += milliseconds(1);
      while (BenchTime::now() < next)
        inbox.dispatch(
            std::max<std::chrono::nanoseconds>(next - BenchTime::now(), std::chrono::nanoseconds(1)));
    }
    const auto count = found.size();
    (void)!write(pipes[1], &count, sizeof count);
    for (std::size_t done = 0; done < count * sizeof(double);) {
      const ssize_t size =
          write(pipes[1], reinterpret_cast<const char*>(found.data()) + done, count * sizeof(double) - done);
      if (size <= 0) break;
      done += static_cast<std::size_t>(size);
    }
  });
  close(pipes[1]);
  std::size_t count = 0;
  if (read(pipes[0], &count, sizeof count) == static_cast<ssize_t>(sizeof count)) {
    trips.resize(count);
    for (std::size_t done = 0; done < count * sizeof(double);) {
      const ssize_t size =
          read(pipes[0], reinterpret_cast<char*>(trips.data()) + done, count * sizeof(double) - done);
      if (size <= 0) break;
      done += static_cast<std::size_t>(size);
    }
  }
  close(pipes[0]);
  return trips;
}

/// A session with a simulated trainee, in contact: what its station states of the age of its force.
Result<Telemetry> measureSession(const Options& options) {
  Children children;
  const std::string domain = std::to_string(options.domain), session = "bench";
  children.start({options.programs / "tenon-serve", options.scenario, "--detail", "0.12", "--session",
                  session, "--domain", domain, "--wait-for", "right"});
  children.start({options.programs / "tenon-join", "--role", "trainee", "--session", session, "--domain",
                  domain, "--arm", "--wait", "120"});
  const std::atomic<bool> stop{false};
  auto member = wire::Membership::find(
      {.session = session, .domain = options.domain, .person = "bench", .timeout = std::chrono::seconds(120)},
      stop);
  if (!member) return fail(member.error().what);
  std::optional<Telemetry> last;
  wire::Inbox inbox;
  if (auto heard = inbox.on<Telemetry>((*member)->session(), wire::kTelemetry,
                                       [&](const Telemetry& telemetry) { last = telemetry; });
      !heard)
    return fail(heard.error().what);
  const auto until = BenchTime::now() + std::chrono::seconds(options.seconds + 60);
  while (BenchTime::now() < until && (!last || last->samples < 1000ULL * options.seconds))
    inbox.dispatch(milliseconds(100));
  if (!last) return fail("the station of the session never stated its link");
  return *last;
}

Result<void> measure(const Options& options, bool loaded) {
  Children busy;
  const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
  for (unsigned i = 0; loaded && i < cores; ++i)
    busy.run([] {
      for (volatile unsigned count = 0;;) count = count + 1;
    });
  const double half = options.seconds / 2.0;
  std::vector<double> tuned = pingPong(options, kTuned, half);
  const Quantiles reliable = quantilesOf(pingPong(options, kReliable, half));
  const auto session = measureSession(options);
  if (!session) return fail(session.error().what);
  const std::vector<double> after = pingPong(options, kTuned, half);
  tuned.insert(tuned.end(), after.begin(), after.end());
  const Quantiles bare = quantilesOf(tuned);
  const auto row = [](std::string_view what, const Quantiles& found) {
    fmt::print("  {:42} p50 {:7.3f} ms   p99 {:7.3f} ms\n", what, 1e3 * found.p50, 1e3 * found.p99);
  };
  fmt::print("{}\n", loaded ? fmt::format("{} cores busy", cores) : std::string("idle"));
  row("ping-pong, streams (best effort)", bare);
  row("ping-pong, reliable, all kept", reliable);
  const Quantiles force{session->input_to_force_p50, session->input_to_force_p99};
  row("session: device sample to displayed force", force);
  const Quantiles target{1.5 * bare.p50 + 1e-3, 3.0 * bare.p99 + 1e-3};
  row("target: 1.5 x p50 + 1 ms, 3 x p99 + 1 ms", target);
  fmt::print(
      "  {}; jitter {:.3f} ms, {:.2f} % of inputs lost, {:.2f} % replaced, {:.2f} % of contacts not taken, "
      "{} forces\n",
      force.p50 <= target.p50 && force.p99 <= target.p99 ? "met" : "NOT met", 1e3 * session->jitter,
      1e2 * session->inputs_lost, 1e2 * session->inputs_replaced, 1e2 * session->answers_lost,
      session->samples);
  fmt::print("  clock of the server, which is the same one: {:+.3f} ms, +-{:.3f} ms\n",
             1e3 * session->clock_offset, 1e3 * session->clock_error);
  std::fflush(stdout);
  return {};
}

}  // namespace
}  // namespace tenon::bench

int main(int argc, char** argv) {
  CLI::App app(
      "Age of the displayed force between processes, beside a bare DDS ping-pong of the same messages.",
      "tenon bench link");
  tenon::bench::Options options;
  options.programs = std::filesystem::absolute(argv[0]).parent_path();
  options.scenario = "peg_and_box";
  app.add_option("--programs", options.programs, "folder of Tenon's programs")->capture_default_str();
  app.add_option("--scenario", options.scenario, "of the session")->capture_default_str();
  app.add_option("--seconds", options.seconds, "of each measurement")->capture_default_str();
  app.add_option("--domain", options.domain, "DDS domain, 0 to 230")
      ->check(CLI::Range(0, 230))
      ->capture_default_str();
  app.footer("Exit code: 0 measured (a missed target is printed, not an error), 1 could not, 2 wrong usage.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  for (const bool loaded : {false, true})
    if (const auto measured = tenon::bench::measure(options, loaded); !measured) {
      fmt::print(stderr, "tenon bench link: {}\n", measured.error().what);
      return 1;
    }
  return 0;
}
