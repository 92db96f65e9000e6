#pragma once

#include <string>
#include <string_view>
#include <vector>

/// Texts for people, in their languages.
namespace tenon {

struct LocalizedText {
  std::string language;  ///< `en`, `de`, ...
  std::string text;
};

/// The text in `language`, else the first one; empty when there is none.
[[nodiscard]] inline std::string localized(const std::vector<LocalizedText>& texts,
                                           std::string_view language) {
  for (const LocalizedText& text : texts)
    if (text.language == language) return text.text;
  return texts.empty() ? std::string() : texts.front().text;
}

}  // namespace tenon
