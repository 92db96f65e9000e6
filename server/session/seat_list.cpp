#include "server/session/seat_list.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "idl/types/printable_text.h"
#include "idl/wire/identity.h"

namespace tenon::session {

std::filesystem::path seatFileOf(const std::filesystem::path& journal) { return journal.string() + ".seats"; }

Result<void> writeSeats(const std::filesystem::path& file, const std::vector<KeptSeat>& seats) {
  // a line a seat, in the order of their ids
  std::string text;
  for (const KeptSeat& seat : seats)
    text += fmt::format("{} {} {} {}\n", seat.client.value, static_cast<int>(seat.role),
                        seat.key.empty() ? "-" : seat.key, printable(seat.name));
  const std::filesystem::path next = file.string() + ".next";
  const int descriptor = open(next.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  bool written =
      descriptor >= 0 && ::write(descriptor, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  if (descriptor >= 0) close(descriptor);
  written = written && rename(next.c_str(), file.c_str()) == 0;
  if (!written)
    return fail(fmt::format("{}: cannot be written ({}); after a crash of the server clients get new seats",
                            file.string(), std::strerror(errno)));
  return {};
}

Result<std::vector<KeptSeat>> readSeats(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) return fail(fmt::format("{}: cannot be read; clients get new seats", file.string()));
  std::vector<KeptSeat> seats;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    KeptSeat seat;
    int role = 0;
    const bool read = static_cast<bool>(words >> seat.client.value >> role >> seat.key);
    if (seat.key == "-") seat.key.clear();
    const bool known = role >= 0 && role <= static_cast<int>(Role::kRecorder);
    if (!read || !known || seat.client.value != seats.size() + 1 ||
        (!seat.key.empty() && !wire::readHexText(seat.key)))
      return fail(fmt::format("{}:{}: is damaged; clients get new seats", file.string(), seats.size() + 1));
    seat.role = static_cast<Role>(role);
    words.get();
    std::getline(words, seat.name);
    seats.push_back(std::move(seat));
  }
  return seats;
}

}  // namespace tenon::session
