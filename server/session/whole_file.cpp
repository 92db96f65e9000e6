#include "server/session/whole_file.h"

#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace tenon::session {
namespace {

constexpr off_t kMostBytes = 16 << 20;

/// The error's number; 0: none.
int writeTo(int descriptor, const std::string& text, bool synchronised) {
  for (std::size_t written = 0; written < text.size();) {
    const ssize_t size = ::write(descriptor, text.data() + written, text.size() - written);
    if (size < 0 && errno != EINTR) return errno;
    if (size > 0) written += static_cast<std::size_t>(size);
  }
  return synchronised && fsync(descriptor) != 0 ? errno : 0;
}

/// All of `text`, which has the file's size. The error's number; 0: none.
int readFrom(int descriptor, std::string& text) {
  std::size_t filled = 0;
  while (filled < text.size()) {
    const ssize_t size = ::read(descriptor, text.data() + filled, text.size() - filled);
    if (size == 0) return EIO;  // it was cut meanwhile
    if (size < 0 && errno != EINTR) return errno;
    if (size > 0) filled += static_cast<std::size_t>(size);
  }
  return 0;
}

}  // namespace

std::string writeWhole(const std::filesystem::path& file, const std::string& text, bool synchronised) {
  const int descriptor = open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (descriptor < 0) return std::strerror(errno);
  const int problem = writeTo(descriptor, text, synchronised);
  close(descriptor);
  return problem == 0 ? "" : std::strerror(problem);
}

Result<std::string> readWhole(const std::filesystem::path& file) {
  const int descriptor = open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) return fail(std::strerror(errno));
  struct stat status {};
  std::string text, why;
  if (fstat(descriptor, &status) != 0) {
    why = std::strerror(errno);
  } else if (!S_ISREG(status.st_mode)) {
    why = "is not a file";
  } else if (status.st_size > kMostBytes) {
    why = "too large";
  } else {
    text.resize(static_cast<std::size_t>(status.st_size));
    if (const int problem = readFrom(descriptor, text); problem != 0) why = std::strerror(problem);
  }
  close(descriptor);
  if (!why.empty()) return fail(why);
  return text;
}

}  // namespace tenon::session
