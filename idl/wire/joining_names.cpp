#include "idl/wire/joining_names.h"

#include "idl/types/printable_text.h"

namespace tenon::wire {
namespace {

Result<void> check(std::string_view name, std::size_t longest, const char* whose) {
  const std::string shown = printable(name);
  if (!name.empty() && name.size() <= longest && shown == name) return {};
  return fail("'" + shortened(shown, longest) + "' is no name of a " + whose + ": expected 1 to " +
              std::to_string(longest) + " bytes of UTF-8 without control characters");
}

}  // namespace

Result<void> checkPersonName(std::string_view name) { return check(name, kLongestPersonName, "person"); }
Result<void> checkHandName(std::string_view name) { return check(name, kLongestHandName, "hand"); }

}  // namespace tenon::wire
