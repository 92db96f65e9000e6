#include "idl/threads/scheduling.h"

#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>

#include <pthread.h>
#include <sched.h>

namespace tenon::threads {
namespace {

std::string raise(pid_t thread, const std::string& name, int priority) {
  sched_param parameter{};
  parameter.sched_priority = priority;
  if (sched_setscheduler(thread, SCHED_FIFO | SCHED_RESET_ON_FORK, &parameter) == 0) return {};
  return "thread '" + name + "' runs without real-time priority " + std::to_string(priority) + " (" +
         std::strerror(errno) + ")";
}

/// Without its line end.
std::string nameOf(const std::filesystem::path& task) {
  std::ifstream file(task / "comm");
  std::string name;
  std::getline(file, name);
  return name;
}

}  // namespace

std::string shareScheduling(std::span<std::thread> threads) {
  int policy = SCHED_OTHER;
  sched_param parameter{};
  cpu_set_t cpus;
  int error = pthread_getschedparam(pthread_self(), &policy, &parameter);
  if (error == 0) error = pthread_getaffinity_np(pthread_self(), sizeof(cpus), &cpus);
  for (std::thread& thread : threads) {
    const auto keep = [&error](int result) { error = error != 0 ? error : result; };
    if (error == 0) keep(pthread_setschedparam(thread.native_handle(), policy, &parameter));
    if (error == 0) keep(pthread_setaffinity_np(thread.native_handle(), sizeof(cpus), &cpus));
  }
  if (error == 0) return {};
  return std::string("the workers run without the scheduling of their caller (") + std::strerror(error) + ")";
}

std::string raiseThisThread(int priority) {
  return raise(0, nameOf("/proc/thread-self"), priority);  // 0: the calling thread
}

std::string raiseThreadsNamed(std::span<const NamedPriority> priorities) {
  std::string refused;
  std::error_code error;
  for (std::filesystem::directory_iterator task("/proc/self/task", error), end; !error && task != end;
       task.increment(error)) {
    const std::string number = task->path().filename();
    const std::string name = nameOf(task->path());
    pid_t thread = 0;
    std::from_chars(number.data(), number.data() + number.size(), thread);
    for (const NamedPriority& wanted : priorities) {
      if (!name.starts_with(wanted.begin)) continue;
      const std::string why = raise(thread, name, wanted.priority);
      if (refused.empty()) refused = why;
    }
  }
  return refused;
}

void nameThisThread(const std::string& name) {
  constexpr std::size_t kMaxLength = 15;
  pthread_setname_np(pthread_self(), name.substr(0, kMaxLength).c_str());
}

}  // namespace tenon::threads
