#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tenon {

/// The files of a command line. Empty paths are options that were not given.
struct ProgramFiles {
  std::vector<std::filesystem::path> outputs;
  std::vector<std::filesystem::path> inputs;
  bool overwrite = false;  ///< `--overwrite` was given
};

/// Help of the option `--overwrite`.
inline constexpr const char* kOverwriteHelp = "replace output files that exist";

/// Why a program must not write, and its exit code.
struct OutputRefusal {
  std::string what;  ///< one sentence that names the file
  int exit_code = 1;
};

/// Checks the outputs of a program before its work begins. An output that is an input, under whatever name,
/// is wrong usage (exit code 2), with `--overwrite` too; one that exists is refused (1) without
/// `--overwrite`, a folder always. Devices and pipes, such as /dev/null, never count as existing. Null: all
/// may be written.
///
/// Threads: any. Real-time: no.
[[nodiscard]] std::optional<OutputRefusal> refuseOutputs(const ProgramFiles& files);

/// Whether `file` is a device or a pipe: written in place, where a file is replaced by a complete new one.
///
/// Threads: any. Real-time: no.
[[nodiscard]] bool isWrittenInPlace(const std::filesystem::path& file);

}  // namespace tenon
