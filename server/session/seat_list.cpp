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
    text += fmt::format("{} {} {} {} {}\n", seat.client.value, static_cast<int>(seat.role),
                        seat.key.empty() ? "-" : seat.key, seat.is_closed ? "closed" : "open",
                        printable(seat.name));
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
  return seats;
}

SeatKeeper::SeatKeeper(std::filesystem::path file) : file_(std::move(file)), thread_([this] { run(); }) {}

SeatKeeper::~SeatKeeper() {
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

std::uint64_t SeatKeeper::keep(std::vector<KeptSeat> seats) {
  const std::uint64_t number = [&] {
    const std::lock_guard lock(mutex_);
    waiting_ = std::move(seats);
    return ++kept_;
  }();
  changed_.notify_one();
  return number;
}

bool SeatKeeper::isDone(std::uint64_t number) {
  const std::lock_guard lock(mutex_);
  return done_ >= number;
}

std::optional<std::string> SeatKeeper::takeError() {
  const std::lock_guard lock(mutex_);
  return std::exchange(error_, std::nullopt);
}

void SeatKeeper::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return ends_ || waiting_; });
    if (!waiting_) return;
    const std::vector<KeptSeat> seats = *std::exchange(waiting_, std::nullopt);
    const std::uint64_t number = kept_;
    lock.unlock();
    const Result<void> written = writeSeats(file_, seats);
    lock.lock();
    done_ = number;
    if (!written) error_ = written.error().what;
  }
}

}  // namespace tenon::session
