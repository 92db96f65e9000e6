#include "idl/threads/scheduling.h"

#include <array>
#include <atomic>
#include <thread>

#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>

namespace tenon::threads {
namespace {

int policyOf(std::thread& thread) {
  int policy = 0;
  sched_param parameter{};
  pthread_getschedparam(thread.native_handle(), &policy, &parameter);
  return policy & ~SCHED_RESET_ON_FORK;
}

/// Waits under a name until it is destroyed.
class NamedThread {
 public:
  explicit NamedThread(const char* name)
      : thread([this, name] {
          nameThisThread(name);
          named_ = true;
          named_.notify_one();
          ends_.wait(false);
        }) {
    named_.wait(false);
  }
  ~NamedThread() {
    ends_ = true;
    ends_.notify_one();
    thread.join();
  }
  NamedThread(const NamedThread&) = delete;
  NamedThread& operator=(const NamedThread&) = delete;

 private:
  std::atomic<bool> named_ = false, ends_ = false;

 public:
  std::thread thread;  ///< last: it uses the others
};

TEST(Scheduling, ThreadsAreRaisedByTheBeginOfTheirNameOrTheReasonIsSaid) {
  NamedThread wanted("probeOne"), other("another");
  const std::array<NamedPriority, 1> priorities{{{"probe", 3}}};
  const std::string refused = raiseThreadsNamed(priorities);
  EXPECT_EQ(policyOf(other.thread), SCHED_OTHER);
  if (refused.empty()) {
    EXPECT_EQ(policyOf(wanted.thread), SCHED_FIFO);
  } else {
    EXPECT_NE(refused.find("thread 'probeOne' runs without real-time priority 3"), std::string::npos)
        << refused;
    EXPECT_EQ(policyOf(wanted.thread), SCHED_OTHER);
  }
}

TEST(Scheduling, AThreadThatARaisedOneStartsHasTheDefault) {
  int inner = -1;
  std::thread outer([&] {
    static_cast<void>(raiseThisThread(3));
    std::thread([&] { inner = sched_getscheduler(0); }).join();
  });
  outer.join();
  EXPECT_EQ(inner, SCHED_OTHER);
}

}  // namespace
}  // namespace tenon::threads
