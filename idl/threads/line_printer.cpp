#include "idl/threads/line_printer.h"

#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <thread>
#include <utility>

#include <poll.h>
#include <unistd.h>

namespace tenon::threads {

struct LinePrinter::Lines {
  int descriptor = -1;
  std::mutex mutex;
  std::condition_variable changed;
  std::deque<std::string> waiting;
  std::uint64_t dropped = 0;  // since the last line that waits
  bool writing = false;       // a line is with the operating system
  bool ended = false;
};

namespace {

/// Waits for the reader. What cannot be written is lost.
void writeLine(int descriptor, std::string line) {
  line += '\n';
  for (std::size_t at = 0; at < line.size();) {
    const ssize_t written = write(descriptor, line.data() + at, line.size() - at);
    if (written > 0) at += static_cast<std::size_t>(written);
    if (written >= 0 || errno == EINTR) continue;
    if (errno != EAGAIN) return;
    pollfd ready{descriptor, POLLOUT, 0};
    static_cast<void>(poll(&ready, 1, -1));
  }
}

}  // namespace

LinePrinter::LinePrinter(int descriptor) : lines_(std::make_shared<Lines>()) {
  lines_->descriptor = descriptor;
  std::thread([lines = lines_] {
    std::unique_lock lock(lines->mutex);
    while (true) {
      lines->changed.wait(lock, [&] { return lines->ended || !lines->waiting.empty(); });
      if (lines->waiting.empty()) return;
      std::string line = std::move(lines->waiting.front());
      lines->waiting.pop_front();
      lines->writing = true;
      lock.unlock();
      writeLine(lines->descriptor, std::move(line));
      lock.lock();
      lines->writing = false;
      lines->changed.notify_all();
    }
  }).detach();
}

LinePrinter::~LinePrinter() {
  std::unique_lock lock(lines_->mutex);
  lines_->changed.wait_for(lock, std::chrono::duration<double>(kPatience),
                           [this] { return lines_->waiting.empty() && !lines_->writing; });
  lines_->waiting.clear();
  lines_->ended = true;
  lines_->changed.notify_all();
}

void LinePrinter::print(std::string line) {
  const std::lock_guard lock(lines_->mutex);
  if (lines_->waiting.size() >= kMostWaiting) {
    ++lines_->dropped;
    return;
  }
  if (const std::uint64_t dropped = std::exchange(lines_->dropped, 0); dropped > 0)
    lines_->waiting.push_back("... " + std::to_string(dropped) +
                              " lines are missing here: nobody read them in time");
  lines_->waiting.push_back(std::move(line));
  lines_->changed.notify_all();
}

}  // namespace tenon::threads
