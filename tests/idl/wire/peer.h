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

/// A domain of this test process: programs of other test runs on this machine stay apart.
inline std::uint32_t ownDomain() { return 20 + static_cast<std::uint32_t>(getpid()) % 200; }

inline std::shared_ptr<Participant> participant(std::uint32_t domain,
                                                LinkProfile profile = LinkProfile::kLan) {
  auto opened = Participant::open({.domain = domain, .profile = profile, .config = {}});
  if (!opened) throw std::runtime_error(opened.error().what);
  return *opened;
}

/// Another process that runs a function; made before this one has touched DDS, because DDS does not survive a
/// fork.
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

  /// Without a chance to say good-bye.
  void kill() {
    ::kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }

 private:
  pid_t pid_;
};

/// Dispatches until `done`; false when that has not come after a minute.
inline bool dispatchUntil(Inbox& inbox, const std::function<bool()>& done) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (!done()) {
    if (std::chrono::steady_clock::now() > end) return false;
    inbox.dispatch(std::chrono::milliseconds(20));
  }
  return true;
}

}  // namespace tenon::test
