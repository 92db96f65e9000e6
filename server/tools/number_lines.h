#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <istream>
#include <string>
#include <utility>
#include <vector>

#include "idl/types/result.h"

namespace tenon::tools {

/// Reads numbers from text: `count` finite numbers per line, separated by blanks. Empty lines and comments
/// from # on are skipped. Errors name the source and the line.
///
/// Threads: one. Real-time: no.
class NumberLines {
 public:
  NumberLines(std::istream& in, std::string source, std::size_t count)
      : in_(in), source_(std::move(source)), numbers_(count) {}

  /// Reads the next line into numbers(). False at the end of the input.
  [[nodiscard]] Result<bool> next() {
    std::string text;
    while (std::getline(in_, text)) {
      ++line_;
      text.resize(std::min(text.find('#'), text.size()));
      if (text.find_first_not_of(kBlank) == std::string::npos) continue;
      if (const auto ok = parse(text); !ok) return tl::unexpected(ok.error());
      return true;
    }
    if (in_.bad()) return fail(source_ + ": cannot be read");
    return false;
  }

  [[nodiscard]] const std::vector<double>& numbers() const { return numbers_; }
  /// Source and line number of the last line read.
  [[nodiscard]] std::string position() const { return source_ + ":" + std::to_string(line_); }

 private:
  static constexpr const char* kBlank = " \t\r";

  Result<void> parse(const std::string& text) {
    std::size_t found = 0;
    std::size_t begin = text.find_first_not_of(kBlank);
    while (begin != std::string::npos) {
      const std::size_t end = std::min(text.find_first_of(kBlank, begin), text.size());
      const std::string word = text.substr(begin, end - begin);
      char* parsed = nullptr;
      const double number = std::strtod(word.c_str(), &parsed);
      if (parsed != word.c_str() + word.size()) {
        return fail(position() + ": '" + word.substr(0, 40) + "' is not a number");
      }
      if (!std::isfinite(number)) return fail(position() + ": '" + word.substr(0, 40) + "' is not finite");
      if (found < numbers_.size()) numbers_[found] = number;
      ++found;
      begin = text.find_first_not_of(kBlank, end);
    }
    if (found == numbers_.size()) return {};
    return fail(position() + ": " + std::to_string(found) + " numbers where " +
                std::to_string(numbers_.size()) + " are expected");
  }

  std::istream& in_;
  std::string source_;
  std::size_t line_ = 0;
  std::vector<double> numbers_;  ///< [any unit] of the last line
};

}  // namespace tenon::tools
