#include "server/session/session_lock.h"

#include <cctype>
#include <cerrno>
#include <cstring>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

namespace tenon::session {

std::string hostName() {
  char name[64] = {};
  return gethostname(name, sizeof name - 1) == 0 && name[0] != '\0' ? name : "this machine";
}

std::string servedAlready(const std::string& session, const std::string& process, const std::string& host) {
  return fmt::format(
      "session '{}' is served already, by process {} on host {}: stop that one, or choose another name with "
      "--session",
      session, process, host);
}

std::string fileNamePart(const std::string& text) {
  std::string part;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    part += std::isalnum(byte) != 0 || c == '-' ? std::string(1, c) : fmt::format("%{:02X}", byte);
  }
  return part;
}

Result<SessionLock> SessionLock::take(std::uint32_t domain, const std::string& session) {
  const std::filesystem::path file = std::filesystem::temp_directory_path() /
                                     fmt::format("tenon-session-{}-{}", domain, fileNamePart(session));
  int descriptor = open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0644);
  // another user's, left by a former server: it can be locked all the same
  const bool mine = descriptor >= 0;
  if (!mine) descriptor = open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
  if (descriptor < 0)
    return fail(fmt::format("{}: cannot be opened ({})", file.string(), std::strerror(errno)));
  if (flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    char holder[32] = {};
    const ssize_t size = pread(descriptor, holder, sizeof holder - 1, 0);
    close(descriptor);
    return fail(servedAlready(session, size > 0 ? holder : "unknown", hostName()));
  }
  const std::string pid = std::to_string(getpid());
  const bool noted = mine && ftruncate(descriptor, 0) == 0 &&
                     pwrite(descriptor, pid.data(), pid.size(), 0) == static_cast<ssize_t>(pid.size());
  static_cast<void>(noted);  // it serves the message above alone
  return SessionLock(descriptor);
}

SessionLock::SessionLock(SessionLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
SessionLock& SessionLock::operator=(SessionLock&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  return *this;
}
SessionLock::~SessionLock() {
  if (descriptor_ >= 0) close(descriptor_);
}

}  // namespace tenon::session
