#pragma once

#include <cstddef>
#include <memory>
#include <string>

namespace tenon::threads {

/// Writes lines to a terminal, pipe or file on a thread of its own: whoever prints never waits for a reader
/// that stands still (a terminal after Ctrl-S, a pager, a hung connection).
///
/// Up to kMostWaiting lines wait. Those beyond are dropped; the next one that is printed is preceded by a
/// line that says how many. The destructor gives a reader kPatience for the rest, and drops what is then
/// left.
///
/// Threads: any. Real-time: no.
class LinePrinter {
 public:
  static constexpr std::size_t kMostWaiting = 1000;
  static constexpr double kPatience = 2.0;  ///< [s]
  static constexpr int kOutput = 1;         ///< descriptor of standard output
  static constexpr int kError = 2;          ///< of standard error

  /// `descriptor` stays open. Where its reader has ended, SIGPIPE ends the program, unless it is ignored.
  explicit LinePrinter(int descriptor);
  ~LinePrinter();
  LinePrinter(const LinePrinter&) = delete;
  LinePrinter& operator=(const LinePrinter&) = delete;

  void print(std::string line);

 private:
  struct Lines;
  std::shared_ptr<Lines> lines_;  // with the thread, which a reader may hold longer than this lives
};

}  // namespace tenon::threads
