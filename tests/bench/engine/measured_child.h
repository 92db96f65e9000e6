#pragma once

#include <string>
#include <vector>

#include "idl/types/result.h"

namespace tenon::bench {

/// Resources used by a process from start to exit.
struct ProcessUsage {
  double wall = 0.0;          ///< [s]
  double cpu = 0.0;           ///< [s] of all its threads and its children
  double memory_bytes = 0.0;  ///< [bytes] peak resident set of the process or of its largest child
};

/// Runs a program from the folder of this one and waits for it. Its standard error is passed on, its standard
/// output discarded. Fails when it cannot be started or exits with an error.
[[nodiscard]] Result<ProcessUsage> runMeasured(const std::string& program,
                                               const std::vector<std::string>& arguments);

}  // namespace tenon::bench
