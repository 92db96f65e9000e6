#pragma once

#include <string>
#include <string_view>
#include <utility>

#include "idl/types/messages/commands.h"
#include "idl/types/messages/role.h"
#include "idl/types/names.h"
#include "idl/types/printable_text.h"
#include "idl/types/result.h"

namespace tenon::session {

/// Why a command is refused: for displays, and as a sentence.
struct Refused {
  Refusal why = Refusal::kOther;
  std::string what;
};

[[nodiscard]] inline tl::unexpected<Refused> refuse(Refusal why, std::string what) {
  return tl::unexpected<Refused>({why, std::move(what)});
}
/// A text that somebody has sent, as a part of a sentence: that has to fit into an acknowledgement.
[[nodiscard]] inline std::string inQuotes(std::string_view text) {
  constexpr std::size_t kMostShown = 60;  // [bytes]
  const std::string shown = shortened(text, kMostShown);
  return "'" + shown + (shown.size() < text.size() ? "..." : "") + "'";
}
/// What may be named instead: "; it has: left, right", of things with a `name` or of names.
[[nodiscard]] std::string namesInstead(const auto& things) {
  std::string text;
  for (const auto& thing : things) {
    if constexpr (requires { thing.name; })
      text += (text.empty() ? "; it has: " : ", ") + thing.name;
    else
      text += (text.empty() ? "; it has: " : ", ") + thing;
  }
  return text.empty() ? "; it has none" : text;
}

[[nodiscard]] inline tl::unexpected<Refused> notPermitted(Role role) {
  return refuse(Refusal::kNotPermitted,
                "not permitted for the " + std::string(roleName(role)) + ": ask the instructor");
}

}  // namespace tenon::session
