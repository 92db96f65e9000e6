#pragma once

#include <span>
#include <string>
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

/// The name of the calling thread, as `top -H` shows it; 15 characters are used.
void nameThisThread(const std::string& name);

}  // namespace tenon::threads
