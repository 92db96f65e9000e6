#include "idl/threads/line_printer.h"

#include <array>
#include <chrono>
#include <csignal>
#include <optional>
#include <string>
#include <thread>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

namespace tenon::threads {
namespace {

using std::chrono::steady_clock;

/// A pipe whose reader reads when it is told to.
class StandingPipe {
 public:
  StandingPipe() {
    std::signal(SIGPIPE, SIG_IGN);  // a printer's thread may outlast this
    EXPECT_EQ(pipe(ends_.data()), 0);
  }
  /// The writer's end stays open: a printer's thread may write yet.
  ~StandingPipe() { close(ends_[0]); }
  [[nodiscard]] int descriptor() const { return ends_[1]; }
  /// Until `last` has come, or, without, the writer has closed its end.
  std::string readUntil(const std::optional<std::string>& last) {
    std::string text;
    std::array<char, 4096> buffer;
    while (!last || text.find(*last) == std::string::npos) {
      const ssize_t size = read(ends_[0], buffer.data(), buffer.size());
      if (size <= 0) break;
      text.append(buffer.data(), static_cast<std::size_t>(size));
    }
    return text;
  }
  void closeWriter() { close(ends_[1]); }

 private:
  std::array<int, 2> ends_{};
};

TEST(LinePrinter, LinesComeInOrderAndTheLastOneTooWhenItEnds) {
  StandingPipe reader;
  {
    LinePrinter printer(reader.descriptor());
    for (int i = 0; i < 100; ++i) printer.print("line " + std::to_string(i));
  }
  reader.closeWriter();
  std::string expected;
  for (int i = 0; i < 100; ++i) expected += "line " + std::to_string(i) + "\n";
  EXPECT_EQ(reader.readUntil({}), expected);
}

//   a pipe takes 64 KiB, then its writer waits
TEST(LinePrinter, WhoPrintsDoesNotWaitForAReaderThatStandsStill) {
  StandingPipe reader;
  LinePrinter printer(reader.descriptor());
  const std::string line(1000, 'x');
  for (std::size_t i = 0; i < 3 * LinePrinter::kMostWaiting; ++i) printer.print(line);
  std::string text = reader.readUntil(line + "\n" + line);  // it reads again
  while (text.find("lines are missing here") == std::string::npos) {
    printer.print("and on");
    text = reader.readUntil("\n");
  }
  EXPECT_THAT(text, ::testing::ContainsRegex("\\.\\.\\. [0-9]+ lines are missing here"));
}

TEST(LinePrinter, ItsEndIsBoundedThoughNobodyReads) {
  StandingPipe reader;
  const auto began = steady_clock::now();
  {
    LinePrinter printer(reader.descriptor());
    for (int i = 0; i < 200; ++i) printer.print(std::string(1000, 'x'));
  }
  EXPECT_GE(steady_clock::now() - began, std::chrono::duration<double>(0.9 * LinePrinter::kPatience));
}

}  // namespace
}  // namespace tenon::threads
