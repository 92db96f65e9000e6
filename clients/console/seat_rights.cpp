#include "clients/console/seat_rights.h"

#include "idl/types/names.h"
#include "idl/types/printable_text.h"
#include "idl/wire/identity.h"

namespace tenon::console {

namespace {

constexpr std::size_t kMaxPersonName = 63;  // [bytes] of tenon::Join

std::optional<Role> roleNamed(std::string_view name) {
  for (const Role role : {Role::kAdmin, Role::kInstructor, Role::kTrainee})
    if (roleName(role) == name) return role;
  return std::nullopt;
}

}  // namespace

Result<wire::MembershipOptions> membershipOf(const SeatRights& rights, const std::string& session,
                                             const DeskRequest& request) {
  const auto role = roleNamed(request.role);
  if (!role) return fail("there is no seat for '" + shortened(printable(request.role), 40) + "' here");
  if (session.empty()) return fail("there is no session yet");
  const bool has_pass = !rights.pass.empty() && wire::isSameSecret(request.key, rights.pass);
  if (has_pass && role != rights.role && role != Role::kTrainee)
    return fail("this gateway was not started with --role " + request.role);
  wire::MembershipOptions options{.session = session, .domain = rights.domain, .role = *role};
  options.key_file = rights.key_file;
  options.person = request.name.empty() ? "console" : shortened(printable(request.name), kMaxPersonName);
  if (has_pass || (role == Role::kTrainee && rights.is_local)) return options;
  const auto bytes = wire::readHexText(request.key);
  if (!bytes)
    return fail("the role " + request.role + " needs the key of the session: 64 digits, in the file " +
                wire::defaultKeyFile().string() +
                " of the server's user; or the address that `tenon console --role " + request.role +
                "` prints");
  options.key = wire::SharedKey{*bytes};
  return options;
}

}  // namespace tenon::console
