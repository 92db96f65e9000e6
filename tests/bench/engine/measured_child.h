#pragma once

#include <string>
#include <vector>

#include "idl/types/result.h"

namespace tenon::bench {

/// What a program took, from its start to its end.
struct Spent {
  double wall = 0.0;          ///< [s]
  double cpu = 0.0;           ///< [s] of all its threads and its children
  double memory_bytes = 0.0;  ///< its peak, or that of its largest child
};

/// Runs a program that lies beside this one and waits for it; its errors come through, its output does not.
[[nodiscard]] Result<Spent> runMeasured(const std::string& program, const std::vector<std::string>& words);

}  // namespace tenon::bench
