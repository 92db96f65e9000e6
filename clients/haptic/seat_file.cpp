#include "clients/haptic/seat_file.h"

#include <fstream>

namespace tenon {

std::string readToken(const std::filesystem::path& file) {
  constexpr std::size_t kLongest = 63;  // of tenon.idl
  std::string token;
  std::ifstream(file) >> token;
  return token.size() <= kLongest ? token : std::string();
}

Result<void> keepToken(const std::filesystem::path& file, const std::string& token) {
  if (file.empty()) return {};
  using std::filesystem::perms;
  std::ofstream out(file, std::ios::trunc);
  std::error_code refused;
  std::filesystem::permissions(file, perms::owner_read | perms::owner_write, refused);
  out << token << '\n';
  out.flush();
  if (!out) return fail(file.string() + ": cannot be written: a restarted station will get a new seat");
  return {};
}

}  // namespace tenon
