#include "server/session/accepted_commands.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "idl/types/names.h"

namespace tenon::session {

std::string commandText(const Command& command, const std::string& who) {
  return fmt::format("{}: {}{}{}", who, commandName(command.kind), command.text.empty() ? "" : " ",
                     command.text);
}

void AcceptedCommands::update(const CommandCounts& counts, bool is_over) {
  if (!std::exchange(has_begun_, true) && counts.taken == 0) {
    inherited_ = counts.waiting;
    before_ = counts;
    waiting_.insert(waiting_.begin(), inherited_, {});
  }
  const auto gone = [this](const CommandCounts& c) { return inherited_ + c.taken - c.waiting; };
  const std::uint64_t dropped = counts.dropped - before_.dropped;
  const std::uint64_t done = gone(counts) - gone(before_) - dropped;
  before_ = counts;
  // a tick of a stop carries nothing out, and one that ends the run drops what is left
  waiting_.erase(waiting_.begin(),
                 waiting_.begin() + static_cast<std::ptrdiff_t>(std::min<std::uint64_t>(done, waiting())));
  if (is_over) return drop(waiting(), "the run has ended before its tick");
  drop(dropped, "an emergency stop came before its tick");
}

void AcceptedCommands::drop(std::uint64_t count, const char* why) {
  for (; count > 0 && !waiting_.empty(); --count) {
    const std::string& text = waiting_.front();
    dropped_.push_back(
        fmt::format("{} ({})", text.empty() ? "a command from before the restart of the server" : text, why));
    waiting_.pop_front();
  }
}

std::vector<std::string> AcceptedCommands::takeDropped() { return std::exchange(dropped_, {}); }

}  // namespace tenon::session
