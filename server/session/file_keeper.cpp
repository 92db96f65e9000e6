#include "server/session/file_keeper.h"

#include <utility>

namespace tenon::session {

FileKeeper::FileKeeper() : thread_([this] { run(); }) {}

FileKeeper::~FileKeeper() {
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

std::uint64_t FileKeeper::keep(Write write) {
  const std::uint64_t number = [&] {
    const std::lock_guard lock(mutex_);
    waiting_ = std::move(write);
    return ++kept_;
  }();
  changed_.notify_one();
  return number;
}

bool FileKeeper::isDone(std::uint64_t number) {
  const std::lock_guard lock(mutex_);
  return done_ >= number;
}

std::optional<std::string> FileKeeper::takeError() {
  const std::lock_guard lock(mutex_);
  return std::exchange(error_, std::nullopt);
}

void FileKeeper::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return ends_ || waiting_; });
    if (!waiting_) return;
    const Write write = std::exchange(waiting_, nullptr);
    const std::uint64_t number = kept_;
    lock.unlock();
    const Result<void> written = write();
    lock.lock();
    done_ = number;
    if (!written) error_ = written.error().what;
  }
}

}  // namespace tenon::session
