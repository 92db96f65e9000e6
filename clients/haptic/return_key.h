#pragma once

namespace tenon::haptic {

/// Whether a line waits on the terminal: the person has pressed return. Takes it. In the background of a
/// terminal there is none, and who reads there is stopped (SIGTTIN).
///
/// Threads: one. Real-time: no.
[[nodiscard]] bool returnPressed();

}  // namespace tenon::haptic
