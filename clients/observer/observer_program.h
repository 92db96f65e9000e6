#pragma once

#include <atomic>

#include "clients/observer/observer.h"
#include "idl/types/result.h"
#include "idl/wire/membership.h"

namespace tenon {

/// Joins a session as observer and feeds `observer` until the run is over, the server is gone or `stop` is
/// set.
///
/// Threads: one. Real-time: no.
Result<void> observe(Observer& observer, MembershipWishes wishes, const std::atomic<bool>& stop);

}  // namespace tenon
