#include "server/session/loading_display.h"

#include <cstdio>

#include <fmt/format.h>
#include <unistd.h>

namespace tenon::session {

void showOnTerminal(std::string_view activity, double fraction) {
  static const bool is_terminal = isatty(STDERR_FILENO) != 0;
  if (!is_terminal) return;
  fmt::print(stderr, "\r\033[K{:3.0f} %  {}", 100.0 * fraction, activity);
  if (fraction >= 1.0) fmt::print(stderr, "\r\033[K");
  std::fflush(stderr);
}

}  // namespace tenon::session
