#pragma once

#include <array>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>

#include <fcntl.h>
#include <unistd.h>

namespace tenon::test {

/// The disk of a file that this process has open hangs: each write to it waits, until release() or the end of
/// this. What is written from then on is lost. A full pipe that nobody reads stands for the file.
///
/// Threads: one; the file may be another's. Real-time: no.
class HangingDisk {
 public:
  explicit HangingDisk(const std::filesystem::path& file) {
    std::array<int, 2> ends{};
    if (pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    read_ = ends[0];
    const std::array<char, 4096> anything{};
    fcntl(ends[1], F_SETFL, O_NONBLOCK);
    while (write(ends[1], anything.data(), anything.size()) > 0) {
    }
    fcntl(ends[1], F_SETFL, 0);
    const bool is_open = replace(std::filesystem::absolute(file), ends[1]);
    close(ends[1]);
    if (!is_open) throw std::runtime_error("this process has not opened " + file.string());
  }
  ~HangingDisk() { release(); }
  HangingDisk(const HangingDisk&) = delete;
  HangingDisk& operator=(const HangingDisk&) = delete;

  /// Ends with the last of those who write.
  void release() {
    if (read_ < 0) return;
    std::thread([read = read_] {
      std::array<char, 4096> text{};
      while (::read(read, text.data(), text.size()) > 0) {
      }
      close(read);
    }).detach();
    read_ = -1;
  }

 private:
  /// By `by`, wherever this process has `file` open; false: nowhere.
  static bool replace(const std::filesystem::path& file, int by) {
    bool is_open = false;
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
      std::error_code ignored;
      if (std::filesystem::read_symlink(entry.path(), ignored) != file) continue;
      is_open = dup2(by, std::stoi(entry.path().filename().string())) >= 0 || is_open;
    }
    return is_open;
  }

  int read_ = -1;
};

}  // namespace tenon::test
