#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "idl/types/result.h"

namespace tenon::session {

/// The name of this machine.
[[nodiscard]] std::string hostName();

/// The right to serve a session of this name in this DDS domain on this machine: a locked file in the
/// temporary folder. It ends with the process, however that ends; a stopped process keeps it.
///
/// Threads: one. Real-time: no.
class SessionLock {
 public:
  /// Fails when another process has it, and names host and process.
  [[nodiscard]] static Result<SessionLock> take(std::uint32_t domain, const std::string& session);
  SessionLock(SessionLock&& other) noexcept;
  SessionLock& operator=(SessionLock&& other) noexcept;
  ~SessionLock();

 private:
  explicit SessionLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

/// "session 'a' is served already, by process 7 on host lab: ..."
[[nodiscard]] std::string servedAlready(const std::string& session, const std::string& process,
                                        const std::string& host);

/// `text` as a part of a file's name: what is no letter, digit or dash becomes %XX.
[[nodiscard]] std::string fileNamePart(const std::string& text);

}  // namespace tenon::session
