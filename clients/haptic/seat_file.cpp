#include "clients/haptic/seat_file.h"

#include <fstream>
#include <string>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace tenon::haptic {

namespace {
constexpr std::size_t kMaxLength = 64;  // hexadecimal digits
}  // namespace

bool mayBeSeatFile(const std::filesystem::path& file) {
  std::string key, more;
  std::ifstream(file) >> key >> more;
  return key.size() <= kMaxLength && more.empty();
}

std::optional<wire::SeatKey> readSeatKey(const std::filesystem::path& file) {
  std::string text;
  std::ifstream(file) >> text;
  const auto seed = wire::readHexText(text);
  if (!seed) return std::nullopt;
  return wire::SeatKey{*seed};
}

Result<void> writeSeatKey(const std::filesystem::path& file, const wire::SeatKey& seat) {
  if (file.empty()) return {};
  const std::string text = wire::hexText(seat.seed) + "\n";
  const int descriptor = open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  const bool written = descriptor >= 0 && fchmod(descriptor, 0600) == 0 &&
                       write(descriptor, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  if (descriptor >= 0) close(descriptor);
  if (!written) return fail(file.string() + ": cannot be written; a restarted station will get a new seat");
  return {};
}

}  // namespace tenon::haptic
