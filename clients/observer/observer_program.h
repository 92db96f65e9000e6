#pragma once

#include <atomic>

#include "clients/observer/observer.h"
#include "idl/types/result.h"
#include "idl/wire/membership.h"

namespace tenon::observer {

/// Joins a session as observer and passes its messages to `observer` until the run is over or `stop` is set.
/// Fails with a sentence when no session is found, joining is refused, or the server is lost.
///
/// Threads: one. Real-time: no.
[[nodiscard]] Result<void> observeSession(Observer& observer, wire::MembershipOptions options,
                                          const std::atomic<bool>& stop);

}  // namespace tenon::observer
