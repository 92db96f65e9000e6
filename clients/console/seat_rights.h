#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "clients/console/foxglove_protocol.h"
#include "idl/types/messages/role.h"
#include "idl/types/result.h"
#include "idl/wire/membership.h"

namespace tenon::console {

/// What a gateway gives seats for.
struct SeatRights {
  std::uint32_t domain = 0;        ///< DDS domain
  std::optional<Role> role;        ///< that `pass` gives, with the key of this gateway's user
  std::string pass;                ///< secret of this gateway's life; empty: none
  std::filesystem::path key_file;  ///< of the session's key; empty: wire::defaultKeyFile()
  bool is_local = true;            ///< this machine alone reaches the gateway
};

/// How somebody at a browser joins a session; fails with the reason of a refusal.
///
/// A role that needs the key of the session is given for that key, or for the pass of this gateway: then the
/// gateway proves it with its user's key. Other users of this machine, who can connect as well, have neither.
/// So is a trainee's where others reach the gateway.
///
/// Threads: any. Real-time: no.
[[nodiscard]] Result<wire::MembershipOptions> membershipOf(const SeatRights& rights,
                                                           const std::string& session,
                                                           const DeskRequest& request);

}  // namespace tenon::console
