#pragma once

#include <string>
#include <utility>

#include "idl/types/messages/commands.h"
#include "idl/types/messages/role.h"
#include "idl/types/names.h"
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
[[nodiscard]] inline tl::unexpected<Refused> notPermitted(Role role) {
  return refuse(Refusal::kNotPermitted,
                "not permitted for the " + std::string(roleName(role)) + ": ask the instructor");
}

}  // namespace tenon::session
