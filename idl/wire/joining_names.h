#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "idl/types/result.h"

/// The names in a request to join: so that one that cannot be sent is an error of the command line.
namespace tenon::wire {

// [bytes] the bounds of Join in idl/tenon.idl
inline constexpr std::size_t kLongestPersonName = 63;
inline constexpr std::size_t kLongestHandName = 31;

/// Fail with a sentence that has the rule.
[[nodiscard]] Result<void> checkPersonName(std::string_view name);
[[nodiscard]] Result<void> checkHandName(std::string_view name);

/// Adds the option of a person's name, `flag`, to a program's command line, an instance of CLI11's App.
template <class App, class Name>
auto* addNameOption(App& app, const char* flag, Name& name, const std::string& description) {
  return app.add_option(flag, name, description)->check([](const std::string& text) {
    const auto permitted = checkPersonName(text);
    return permitted ? std::string() : permitted.error().what;
  });
}

}  // namespace tenon::wire
