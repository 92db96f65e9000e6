#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace tenon::bench {

/// One entry of a table: text for display, value for JSON.
struct TableCell {
  TableCell(std::string the_text);  // NOLINT(google-explicit-constructor): rows are written as lists
  TableCell(const char* the_text);  // NOLINT(google-explicit-constructor)
  /// `number` [unit of the column], displayed with three significant digits.
  TableCell(double number);                  // NOLINT(google-explicit-constructor)
  static TableCell none() { return {"-"}; }  ///< not measured

  std::string text;
  nlohmann::json value;
};

/// Results of one benchmark. Column names include the units.
struct Table {
  std::string name;   ///< identifier, without blanks
  std::string title;  ///< for display
  std::vector<std::string> columns;
  std::vector<std::vector<TableCell>> rows;
  std::vector<std::string> notes;  ///< method and limitations
};

/// Text with aligned columns.
[[nodiscard]] std::string toText(const Table& table);

/// JSON with `rows` as objects whose keys are the column names.
[[nodiscard]] nlohmann::json toJson(const Table& table);

}  // namespace tenon::bench
