#include "server/session/stop_file.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "idl/record/mcap_format.h"
#include "idl/wire/codec.h"
#include "server/session/session_lock.h"
#include "server/session/whole_file.h"

namespace tenon::session {
namespace {

constexpr const char* kEnd = "end ";

/// A message in one line: its kind and its bytes as on the bus.
template <class M>
std::string lineOf(std::string_view kind, const M& message) {
  std::string line(kind);
  line += ' ';
  if (const auto bytes = wire::encode(message))
    for (const std::uint8_t byte : *bytes) line += fmt::format("{:02x}", byte);
  return line + "\n";
}

/// The last line of a file with `lines`: their checksum, without which it is damaged.
std::string endOf(const std::string& lines) {
  const auto* const bytes = reinterpret_cast<const std::uint8_t*>(lines.data());
  return fmt::format("{}{:08x}\n", kEnd, record::mcap::crc32({bytes, lines.size()}));
}

std::vector<std::uint8_t> bytesOf(const std::string& hex) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2)
    bytes.push_back(static_cast<std::uint8_t>(std::strtoul(hex.substr(i, 2).c_str(), nullptr, 16)));
  return bytes;
}

template <class M>
bool read(const std::string& hex, M& message) {
  auto decoded = wire::decode<M>(bytesOf(hex));
  if (decoded) message = std::move(*decoded);
  return decoded.has_value();
}

}  // namespace

std::filesystem::path defaultStopFile(std::uint32_t domain, const std::string& session) {
  const char* const state = std::getenv("XDG_STATE_HOME");
  const char* const home = std::getenv("HOME");
  std::filesystem::path folder;
  if (state != nullptr && *state != '\0') {
    folder = state;
  } else if (home != nullptr && *home != '\0') {
    folder = std::filesystem::path(home) / ".local/state";
  } else {
    return {};
  }
  return folder / "tenon" / fmt::format("stop-{}-{}", domain, fileNamePart(session));
}

Result<StopTruth> readStopFile(const std::filesystem::path& file) {
  StopTruth truth;
  if (file.empty()) return truth;
  struct stat status {};
  if (lstat(file.c_str(), &status) != 0 && errno == ENOENT) return truth;
  const auto text = readWhole(file);
  if (!text)
    return fail(fmt::format("{}: cannot be read ({}), so it is not known whether an emergency stop stands",
                            file.string(), text.error().what));
  const auto damaged = [&] {
    return fail(
        fmt::format("{}: is damaged, so it is not known whether an emergency stop stands: see that everybody "
                    "is safe, delete it and start again",
                    file.string()));
  };
  const std::size_t end = text->rfind(kEnd);
  if (end == std::string::npos || text->substr(end) != endOf(text->substr(0, end))) return damaged();
  std::istringstream in(text->substr(0, end));
  std::string line;
  while (std::getline(in, line)) {
    const std::string kind = line.substr(0, line.find(' ')),
                      hex = line.substr(std::min(line.size(), kind.size() + 1));
    EmergencyStop stop;
    EmergencyClear cleared;
    if (kind == "raise" && read(hex, stop)) {
      truth.raise(stop);
    } else if (kind == "clear" && read(hex, cleared)) {
      truth.clear(cleared);
    } else {
      return damaged();
    }
  }
  return truth;
}

Result<void> writeStopFile(const std::filesystem::path& file, const StopTruth& truth) {
  if (file.empty()) return {};
  std::string text;
  for (const auto& [client, stop] : truth.standing()) text += lineOf("raise", stop);
  for (const auto& [client, cleared] : truth.cleared()) text += lineOf("clear", cleared);
  text += endOf(text);
  std::error_code ignored;
  std::filesystem::create_directories(file.parent_path(), ignored);
  const std::filesystem::path next = file.string() + ".next";
  if (const std::string problem = writeWhole(next, text, true); !problem.empty())
    return fail(fmt::format("{}: cannot be written ({})", next.string(), problem));
  if (rename(next.c_str(), file.c_str()) != 0)
    return fail(fmt::format("{}: cannot be replaced ({})", file.string(), std::strerror(errno)));
  const int folder = open(file.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const bool synced = folder >= 0 && fsync(folder) == 0;
  if (folder >= 0) close(folder);
  if (!synced) return fail(fmt::format("{}: cannot be synchronised", file.parent_path().string()));
  return {};
}

}  // namespace tenon::session
