#include "server/session/whole_file.h"

#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <unistd.h>

namespace tenon::session {
namespace {

/// The error's number; 0: none.
int writeTo(int descriptor, const std::string& text, bool synchronised) {
  for (std::size_t written = 0; written < text.size();) {
    const ssize_t size = ::write(descriptor, text.data() + written, text.size() - written);
    if (size < 0 && errno != EINTR) return errno;
    if (size > 0) written += static_cast<std::size_t>(size);
  }
  return synchronised && fsync(descriptor) != 0 ? errno : 0;
}

}  // namespace

std::string writeWhole(const std::filesystem::path& file, const std::string& text, bool synchronised) {
  const int descriptor = open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (descriptor < 0) return std::strerror(errno);
  const int problem = writeTo(descriptor, text, synchronised);
  close(descriptor);
  return problem == 0 ? "" : std::strerror(problem);
}

}  // namespace tenon::session
