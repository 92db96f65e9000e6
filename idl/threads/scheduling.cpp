#include "idl/threads/scheduling.h"

#include <cstring>

#include <pthread.h>
#include <sched.h>

namespace tenon::threads {

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

void nameThisThread(const std::string& name) {
  constexpr std::size_t kMaxLength = 15;
  pthread_setname_np(pthread_self(), name.substr(0, kMaxLength).c_str());
}

}  // namespace tenon::threads
