/// A network link with given delay, jitter and loss between two network namespaces, for tests/system.
///
///   link_relay NAMESPACE_A ADDRESS_A NAMESPACE_B ADDRESS_B [KEY=VALUE...]
///
/// Makes an Ethernet device `link0` in each namespace (a TAP, /24, multicast works), carries frames between
/// them and prints "ready". Keys: delay and jitter [s, one way], loss [share of frames], burst [frames lost
/// in a row], seed, mtu [bytes]. A frame is delivered `delay` after it was sent, and up to `jitter` later, in
/// order. Losses and jitter follow from seed and number of the frame alone. Lines on stdin: "partition
/// SECONDS" stops both directions; the end of stdin ends the program, which then prints the frames and losses
/// of both. Exit code: 0; 1 without the permission or a namespace; 2 for wrong usage.
#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <map>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/if_tun.h>
#include <net/if.h>
#include <poll.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

namespace tenon::test {
namespace {

using SteadyTime = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

void demand(bool done, const std::string& what) {
  if (!done) throw std::runtime_error(what + ": " + std::strerror(errno));
}

struct LinkModel {
  double delay = 0.0;   ///< [s]
  double jitter = 0.0;  ///< [s]
  double loss = 0.0;    ///< [-]
  unsigned burst = 1;   ///< frames
  std::uint64_t seed = 1;
  int mtu = 1500;  ///< [bytes]
};

/// Opens a TAP device with an address in a namespace of /run/netns; returns its file descriptor.
int openDevice(const std::string& network, const std::string& address, int mtu) {
  const int file = open(("/run/netns/" + network).c_str(), O_RDONLY | O_CLOEXEC);
  demand(file >= 0, "namespace " + network);
  demand(setns(file, CLONE_NEWNET) == 0, "entering namespace " + network);
  close(file);
  const int tap = open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC);
  demand(tap >= 0, "/dev/net/tun");
  ifreq request{};
  std::strncpy(request.ifr_name, "link0", IFNAMSIZ - 1);
  request.ifr_flags = IFF_TAP | IFF_NO_PI;
  demand(ioctl(tap, TUNSETIFF, &request) == 0, "device link0 in " + network);
  const int control = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  demand(control >= 0, "socket");
  const auto set = [&](unsigned long what, const char* text) {
    sockaddr_in value{};
    value.sin_family = AF_INET;
    if (inet_pton(AF_INET, text, &value.sin_addr) != 1)
      throw std::runtime_error(std::string(text) + " is no IPv4 address");
    std::memcpy(&request.ifr_addr, &value, sizeof value);
    demand(ioctl(control, what, &request) == 0, std::string("address ") + text + " in " + network);
  };
  set(SIOCSIFADDR, address.c_str());
  set(SIOCSIFNETMASK, "255.255.255.0");
  request.ifr_mtu = mtu;
  demand(ioctl(control, SIOCSIFMTU, &request) == 0, "mtu in " + network);
  for (const char* device : {"lo", "link0"}) {
    std::strncpy(request.ifr_name, device, IFNAMSIZ - 1);
    demand(ioctl(control, SIOCGIFFLAGS, &request) == 0, std::string("flags of ") + device);
    request.ifr_flags = static_cast<short>(request.ifr_flags | IFF_UP | IFF_RUNNING);
    demand(ioctl(control, SIOCSIFFLAGS, &request) == 0, std::string("starting ") + device + " in " + network);
  }
  close(control);
  return tap;
}

/// Frames on their way from one side to the other.
class Direction {
 public:
  Direction(int from, int to, const LinkModel& model, std::uint64_t stream)
      : from_(from), to_(to), model_(model), random_(model.seed * 2 + stream) {}

  void receive(bool is_cut) {
    std::array<char, 65536> buffer;
    for (;;) {
      const ssize_t size = read(from_, buffer.data(), buffer.size());
      if (size <= 0) return;
      ++frames_;
      const double lateness = model_.jitter * uniform_(random_);
      const bool starts_burst = uniform_(random_) < model_.loss / model_.burst;
      if (starts_burst) losing_ = model_.burst;
      if (losing_ > 0 || is_cut) {
        losing_ -= losing_ > 0 ? 1 : 0;
        ++lost_;
        continue;
      }
      const auto due = SteadyTime::now() +
                       std::chrono::duration_cast<SteadyTime::duration>(Seconds(model_.delay + lateness));
      newest_due_ = std::max(newest_due_, due);
      waiting_.push_back({newest_due_, {buffer.data(), buffer.data() + size}});
    }
  }

  void deliver() {
    while (!waiting_.empty() && waiting_.front().due <= SteadyTime::now()) {
      const std::vector<char>& bytes = waiting_.front().bytes;
      if (write(to_, bytes.data(), bytes.size()) < 0) ++lost_;
      waiting_.pop_front();
    }
  }

  [[nodiscard]] SteadyTime::time_point nextDue(SteadyTime::time_point latest) const {
    return waiting_.empty() ? latest : std::min(latest, waiting_.front().due);
  }
  [[nodiscard]] int from() const { return from_; }
  void print(const char* name) const {
    std::printf("%s: %llu frames, %llu lost\n", name, static_cast<unsigned long long>(frames_),
                static_cast<unsigned long long>(lost_));
  }

 private:
  struct Frame {
    SteadyTime::time_point due;
    std::vector<char> bytes;
  };
  int from_, to_;
  LinkModel model_;
  std::mt19937_64 random_;
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
  unsigned losing_ = 0;  ///< frames still to be lost in this burst
  std::uint64_t frames_ = 0, lost_ = 0;
  std::deque<Frame> waiting_;
  SteadyTime::time_point newest_due_{};
};

/// Carries out the complete lines of `text`; false for one that cannot be understood.
bool obey(std::string& text, SteadyTime::time_point& cut_until) {
  for (std::size_t end = text.find('\n'); end != std::string::npos; end = text.find('\n')) {
    double seconds = 0.0;
    if (std::sscanf(text.c_str(), "partition %lf", &seconds) != 1) return false;
    cut_until = SteadyTime::now() + std::chrono::duration_cast<SteadyTime::duration>(Seconds(seconds));
    text.erase(0, end + 1);
    std::printf("partition %.3f s\n", seconds);
    std::fflush(stdout);
  }
  return true;
}

int relay(Direction forth, Direction back) {
  std::string commands;
  SteadyTime::time_point cut_until{};
  for (;;) {
    const auto wake = forth.nextDue(back.nextDue(SteadyTime::now() + std::chrono::seconds(1)));
    const auto rest = std::max(wake - SteadyTime::now(), SteadyTime::duration::zero());
    const timespec timeout{rest / std::chrono::seconds(1), (rest % std::chrono::seconds(1)).count()};
    std::array<pollfd, 3> files{
        {{forth.from(), POLLIN, 0}, {back.from(), POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}}};
    demand(ppoll(files.data(), files.size(), &timeout, nullptr) >= 0, "ppoll");
    const bool is_cut = SteadyTime::now() < cut_until;
    if (files[0].revents != 0) forth.receive(is_cut);
    if (files[1].revents != 0) back.receive(is_cut);
    forth.deliver();
    back.deliver();
    if (files[2].revents == 0) continue;
    std::array<char, 256> line;
    const ssize_t size = read(STDIN_FILENO, line.data(), line.size());
    if (size <= 0) break;
    commands.append(line.data(), static_cast<std::size_t>(size));
    if (!obey(commands, cut_until)) {
      std::fprintf(stderr, "link_relay: 'partition SECONDS' is the only command, not %s", commands.c_str());
      return 2;
    }
  }
  forth.print("a to b");
  back.print("b to a");
  return 0;
}

int run(const std::vector<std::string>& arguments) {
  LinkModel model;
  const std::map<std::string, double*> numbers{
      {"delay", &model.delay}, {"jitter", &model.jitter}, {"loss", &model.loss}};
  for (std::size_t i = 4; i < arguments.size(); ++i) {
    const std::size_t sign = std::min(arguments[i].find('='), arguments[i].size());
    const std::string key = arguments[i].substr(0, sign);
    const char* const value = arguments[i].c_str() + std::min(sign + 1, arguments[i].size());
    if (const auto number = numbers.find(key); number != numbers.end()) {
      *number->second = std::strtod(value, nullptr);
    } else if (key == "burst") {
      model.burst = std::max(1U, static_cast<unsigned>(std::strtoul(value, nullptr, 10)));
    } else if (key == "seed") {
      model.seed = std::strtoull(value, nullptr, 10);
    } else if (key == "mtu") {
      model.mtu = static_cast<int>(std::strtol(value, nullptr, 10));
    } else {
      std::fprintf(stderr, "link_relay: there is no key '%s'\n", key.c_str());
      return 2;
    }
  }
  const int a = openDevice(arguments[0], arguments[1], model.mtu);
  const int b = openDevice(arguments[2], arguments[3], model.mtu);
  const sched_param priority{.sched_priority = 85};  // not delayed by what it carries
  (void)sched_setscheduler(0, SCHED_FIFO, &priority);
  std::puts("ready");
  std::fflush(stdout);
  return relay(Direction(a, b, model, 0), Direction(b, a, model, 1));
}

}  // namespace
}  // namespace tenon::test

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.size() < 4) {
    std::fprintf(stderr, "usage: link_relay NAMESPACE_A ADDRESS_A NAMESPACE_B ADDRESS_B [KEY=VALUE...]\n");
    return 2;
  }
  try {
    return tenon::test::run(arguments);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "link_relay: %s\n", problem.what());
    return 1;
  }
}
