#pragma once

#include <chrono>
#include <csignal>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "idl/wire/endpoint.h"

namespace tenon::test {

/// A DDS domain by process id, to separate test runs on one machine.
inline std::uint32_t ownDomain() { return 20 + static_cast<std::uint32_t>(getpid()) % 200; }

inline std::shared_ptr<wire::Participant> participant(std::uint32_t domain,
                                                      wire::LinkProfile profile = wire::LinkProfile::kLan) {
  auto opened = wire::Participant::open({.domain = domain, .profile = profile, .config = {}});
  if (!opened) throw std::runtime_error(opened.error().what);
  return *opened;
}

/// Another process that runs a function; must be created before this process uses DDS, which does not survive
/// a fork.
class Peer {
 public:
  explicit Peer(const std::function<void()>& run) : pid_(fork()) {
    if (pid_ == 0) {
      run();
      _exit(0);
    }
  }
  ~Peer() {
    if (pid_ > 0) kill();
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  /// Without disposing its instances.
  void kill() {
    ::kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }

 private:
  pid_t pid_;
};

/// Dispatches until `done`; false after a minute.
inline bool dispatchUntil(wire::Inbox& inbox, const std::function<bool()>& done) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (!done()) {
    if (std::chrono::steady_clock::now() > end) return false;
    inbox.dispatch(std::chrono::milliseconds(20));
  }
  return true;
}

}  // namespace tenon::test
