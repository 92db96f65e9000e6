#include "server/session/seat_list.h"

#include <cerrno>
#include <cstring>
#include <sstream>

#include <fmt/format.h>

#include "idl/types/printable_text.h"
#include "idl/wire/identity.h"
#include "server/session/whole_file.h"

namespace tenon::session {

std::filesystem::path seatFileOf(const std::filesystem::path& journal) { return journal.string() + ".seats"; }

Result<void> writeSeats(const std::filesystem::path& file, const std::vector<KeptSeat>& seats) {
  // a line a seat, in the order of their ids
  std::string text;
  for (const KeptSeat& seat : seats)
    text += fmt::format("{} {} {} {} {}\n", seat.client.value, static_cast<int>(seat.role),
                        seat.key.empty() ? "-" : seat.key, seat.is_closed ? "closed" : "open",
                        printable(seat.name));
  text += fmt::format("end {}\n", seats.size());
  const std::filesystem::path next = file.string() + ".next";
  std::string problem = writeWhole(next, text, false);
  if (problem.empty() && rename(next.c_str(), file.c_str()) != 0) problem = std::strerror(errno);
  if (!problem.empty())
    return fail(fmt::format("{}: cannot be written ({}); after a crash of the server clients get new seats",
                            file.string(), problem));
  return {};
}

Result<std::vector<KeptSeat>> readSeats(const std::filesystem::path& file) {
  const auto text = readWhole(file);
  if (!text)
    return fail(
        fmt::format("{}: cannot be read ({}); clients get new seats", file.string(), text.error().what));
  std::istringstream in(*text);
  std::vector<KeptSeat> seats;
  std::string line;
  while (std::getline(in, line) && line != fmt::format("end {}", seats.size())) {
    std::istringstream words(line);
    KeptSeat seat;
    int role = 0;
    std::string state;
    const bool read = static_cast<bool>(words >> seat.client.value >> role >> seat.key >> state) &&
                      (state == "open" || state == "closed");
    if (seat.key == "-") seat.key.clear();
    const bool known = role >= 0 && role <= static_cast<int>(Role::kRecorder);
    if (!read || !known || seat.client.value != seats.size() + 1 ||
        (!seat.key.empty() && !wire::readHexText(seat.key)))
      return fail(fmt::format("{}:{}: is damaged; clients get new seats", file.string(), seats.size() + 1));
    seat.role = static_cast<Role>(role);
    seat.is_closed = state == "closed";
    words.get();
    std::getline(words, seat.name);
    seats.push_back(std::move(seat));
  }
  if (!in || in.peek() != EOF)
    return fail(fmt::format("{}:{}: is damaged; clients get new seats", file.string(), seats.size() + 1));
  return seats;
}

}  // namespace tenon::session
