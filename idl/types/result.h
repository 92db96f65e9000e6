#pragma once

#include <string>
#include <utility>

#include <tl/expected.hpp>

namespace tenon {

/// Why an operation failed: one sentence that names the object concerned and, where it helps, the remedy, as
/// in `engine_bay/scenario.yaml:12: part 'grid' has no target pose`.
struct Error {
  std::string what;
};

/// A value or an Error. Used wherever files, network, devices or users can cause a failure; in the tick,
/// faults are data instead.
template <typename T>
using Result = tl::expected<T, Error>;

/// `return fail("no such object");`
[[nodiscard]] inline tl::unexpected<Error> fail(std::string what) {
  return tl::unexpected<Error>(Error{std::move(what)});
}

}  // namespace tenon
