#pragma once

#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include "idl/wire/endpoint.h"

namespace tenon::test {

/// A DDS domain that no other test of this machine uses while this process runs, or a child that it forks:
/// claimed by a locked file, as tests/system/stage.py does.
inline std::uint32_t ownDomain() {
  static const std::uint32_t own = [] {
    for (std::uint32_t domain = 1; domain < 100; ++domain) {
      const auto file =
          std::filesystem::temp_directory_path() / ("tenon-test-domain-" + std::to_string(domain));
      const int opened = open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
      if (opened >= 0 && flock(opened, LOCK_EX | LOCK_NB) == 0) return domain;
      if (opened >= 0) close(opened);
    }
    throw std::runtime_error("all DDS domains of the tests are in use");
  }();
  return own;
}

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
  /// It hangs from now on.
  void stop() { ::kill(pid_, SIGSTOP); }

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
