#pragma once

#include <string>
#include <utility>

#include <tl/expected.hpp>

namespace tenon {

/// Why something could not be done: one sentence that names the thing and, where it helps, what to do next,
/// as in `engine_bay/scenario.yaml:12: part 'grid' has no target pose`.
struct Error {
  std::string what;
};

/// A value, or the sentence that says why there is none. The one vocabulary of failure at every edge
/// (files, network, devices, people); inside the tick faults are data.
template <typename T>
using Result = tl::expected<T, Error>;

/// `return fail("no such object");`
[[nodiscard]] inline tl::unexpected<Error> fail(std::string what) {
  return tl::unexpected<Error>(Error{std::move(what)});
}

}  // namespace tenon
