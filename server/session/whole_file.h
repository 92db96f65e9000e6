#pragma once

#include <filesystem>
#include <string>

#include "idl/types/result.h"

namespace tenon::session {

/// Makes `file` one with this text, of mode 0600; `synchronised`: on the disk when this returns. Empty when
/// that is done, else why it cannot be, as "No space left on device".
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::string writeWhole(const std::filesystem::path& file, const std::string& text,
                                     bool synchronised);
/// What a file of at most 16 MiB has. The error is why it cannot be read; a pipe is not waited for.
[[nodiscard]] Result<std::string> readWhole(const std::filesystem::path& file);

}  // namespace tenon::session
