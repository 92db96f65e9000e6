#include "idl/wire/session_name.h"

#include "idl/types/printable_text.h"

namespace tenon::wire {

Result<void> checkSessionName(std::string_view name) {
  const std::string shown = printable(name);
  const bool is_folder = name == "." || name == "..";
  const bool is_permitted = !name.empty() && !is_folder && name.size() <= kLongestSessionName &&
                            name.find_first_of("*?[]\\/") == std::string_view::npos && shown == name;
  if (is_permitted) return {};
  return fail("'" + shortened(shown, kLongestSessionName) + "' is no name of a session: expected 1 to " +
              std::to_string(kLongestSessionName) +
              " bytes of UTF-8 without control characters and * ? [ ] \\ /, and not . or ..");
}

}  // namespace tenon::wire
