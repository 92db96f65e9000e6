#include "clients/haptic/seat_file.h"

#include <fstream>

namespace tenon::haptic {

namespace {
constexpr std::size_t kMaxLength = 63;  // bound in tenon.idl
}  // namespace

bool mayBeSeatFile(const std::filesystem::path& file) {
  std::string token, more;
  std::ifstream(file) >> token >> more;
  return token.size() <= kMaxLength && more.empty();
}

std::string readSeatToken(const std::filesystem::path& file) {
  std::string token;
  std::ifstream(file) >> token;
  return token.size() <= kMaxLength ? token : std::string();
}

Result<void> writeSeatToken(const std::filesystem::path& file, const std::string& token) {
  if (file.empty()) return {};
  using std::filesystem::perms;
  std::ofstream out(file, std::ios::trunc);
  std::error_code refused;
  std::filesystem::permissions(file, perms::owner_read | perms::owner_write, refused);
  out << token << '\n';
  out.flush();
  if (!out) return fail(file.string() + ": cannot be written; a restarted station will get a new seat");
  return {};
}

}  // namespace tenon::haptic
