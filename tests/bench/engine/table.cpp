#include "tests/bench/engine/table.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

namespace tenon::bench {

namespace {

/// Three significant digits, without exponent down to 1e-4.
std::string readable(double number) {
  const double size = std::abs(number);
  if (number == 0.0) return "0";
  if (size >= 100.0) return fmt::format("{:.0f}", number);
  if (size >= 10.0) return fmt::format("{:.1f}", number);
  if (size >= 1.0) return fmt::format("{:.2f}", number);
  return fmt::format("{:.3g}", number);
}

}  // namespace

TableCell::TableCell(std::string the_text) : text(std::move(the_text)), value(text) {}
TableCell::TableCell(const char* the_text) : TableCell(std::string(the_text)) {}
TableCell::TableCell(double number) : text(readable(number)), value(number) {}

std::string toText(const Table& table) {
  std::vector<std::size_t> widths;
  for (const std::string& column : table.columns) widths.push_back(column.size());
  for (const auto& row : table.rows)
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].text.size());
  std::string text = table.title + "\n";
  const auto line = [&](auto&& textOf) {
    for (std::size_t i = 0; i < widths.size(); ++i)
      text += i == 0 ? fmt::format("  {:<{}}", textOf(i), widths[i])
                     : fmt::format("  {:>{}}", textOf(i), widths[i]);
    text += "\n";
  };
  line([&](std::size_t i) { return table.columns[i]; });
  for (const auto& row : table.rows)
    line([&](std::size_t i) { return i < row.size() ? row[i].text : std::string(); });
  for (const std::string& note : table.notes) text += "  " + note + "\n";
  return text;
}

nlohmann::json toJson(const Table& table) {
  nlohmann::json rows = nlohmann::json::array();
  for (const auto& row : table.rows) {
    nlohmann::json& entry = rows.emplace_back(nlohmann::json::object());
    for (std::size_t i = 0; i < row.size(); ++i) entry[table.columns[i]] = row[i].value;
  }
  return {{"name", table.name}, {"title", table.title}, {"rows", rows}, {"notes", table.notes}};
}

}  // namespace tenon::bench
