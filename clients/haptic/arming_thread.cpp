#include "clients/haptic/arming_thread.h"

namespace tenon::haptic {

void ArmingThread::start() {
  if (under_way_ || !station_.wantsArming()) return;
  if (thread_.joinable()) thread_.join();
  under_way_ = true;
  thread_ = std::thread([this] {
    const auto armed = station_.armDevices();
    if (!armed) print_(armed.error().what);
    under_way_ = false;
  });
}

}  // namespace tenon::haptic
