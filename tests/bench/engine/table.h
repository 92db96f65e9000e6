#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace tenon::bench {

/// What stands in one place of a table: text for people, a value for programs.
struct Cell {
  Cell(std::string words);              // NOLINT(google-explicit-constructor): rows are written as lists
  Cell(const char* words);              // NOLINT(google-explicit-constructor)
  Cell(double number);                  // NOLINT(google-explicit-constructor): three digits that count
  static Cell none() { return {"-"}; }  ///< not measured here

  std::string text;
  nlohmann::json value;
};

/// One measurement, as a person reads it and as a program does. Units stand in the columns' names.
struct Table {
  std::string name;   ///< for programs, without blanks
  std::string title;  ///< for people
  std::vector<std::string> columns;
  std::vector<std::vector<Cell>> rows;
  std::vector<std::string> notes;  ///< how it was measured and what it leaves out
};

/// Columns that stand under each other.
[[nodiscard]] std::string toText(const Table& table);

/// `rows` as objects whose keys are the columns.
[[nodiscard]] nlohmann::json toJson(const Table& table);

}  // namespace tenon::bench
