#pragma once

#include <span>
#include <string>
#include <string_view>
#include <thread>

namespace tenon::threads {

/// Gives running threads the scheduling class, the priority and the permitted CPUs of the calling thread.
/// Returns what the operating system did not grant, or an empty string; the threads run on in any case.
///
/// Threads that work for a real-time thread have to have its priority: else one that is preempted keeps it
/// waiting.
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::string shareScheduling(std::span<std::thread> threads);

/// SCHED_FIFO of `priority` [1..99] for the calling thread; threads that it starts later have the default.
/// Returns what the operating system did not grant, or an empty string; the thread runs on in any case.
[[nodiscard]] std::string raiseThisThread(int priority);

struct NamedPriority {
  std::string_view begin;  ///< of the names of threads, as `top -H` shows them
  int priority = 1;        ///< [1..99] of SCHED_FIFO
};
/// Likewise for threads of this process that a library has started: those whose names begin so.
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::string raiseThreadsNamed(std::span<const NamedPriority> priorities);

/// The name of the calling thread, as `top -H` shows it; 15 characters are used.
void nameThisThread(const std::string& name);

}  // namespace tenon::threads
