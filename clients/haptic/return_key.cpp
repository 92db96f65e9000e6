#include "clients/haptic/return_key.h"

#include <poll.h>
#include <unistd.h>

namespace tenon::haptic {

bool returnPressed() {
  const pid_t foreground = tcgetpgrp(STDIN_FILENO);  // -1: it is not the terminal of this session
  if (foreground != -1 && foreground != getpgrp()) return false;
  pollfd entry{STDIN_FILENO, POLLIN, 0};
  if (poll(&entry, 1, 0) <= 0 || (entry.revents & POLLIN) == 0) return false;
  char line[256];
  return read(STDIN_FILENO, line, sizeof line) > 0;
}

}  // namespace tenon::haptic
