#pragma once

#include <filesystem>
#include <string>

#include "idl/types/result.h"
#include "idl/wire/identity.h"

namespace tenon::wire {

/// What is wrong with the text of an option that names a file, or nothing.
inline std::string namesNoFile(const std::string& text) { return text.empty() ? "names no file" : ""; }

/// Adds `--key` to a program's command line, an instance of CLI11's App.
template <class App>
auto* addKeyOption(App& app, std::filesystem::path& file, const std::string& description) {
  return app.add_option("--key", file, description)->check(namesNoFile);
}

/// Fails when the key that `--key` names cannot be read. Empty: none is named, the user's is taken if it is
/// needed.
inline Result<void> checkKeyOption(const std::filesystem::path& file) {
  if (file.empty()) return {};
  const auto key = readKeyFile(file);
  return key ? Result<void>() : fail("--key: " + key.error().what);
}

}  // namespace tenon::wire
