#include "clients/station/hand_trajectory.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <system_error>

#include <fmt/format.h>

namespace tenon::station {
namespace {

constexpr std::array<std::string_view, 8> kColumns{"t", "x", "y", "z", "qw", "qx", "qy", "qz"};
constexpr std::string_view kHeader = "t,x,y,z,qw,qx,qy,qz";
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
constexpr double kUnitTolerance = 0.01;            // [-] of a quaternion's length
constexpr std::size_t kLargestFile = 256'000'000;  // [bytes]

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// What a file has where something else is expected, for errors: its beginning, printable.
std::string quoted(std::string_view text) {
  constexpr std::size_t kLongest = 40;
  std::string shown = "'";
  for (const char c : text.substr(0, kLongest)) shown += c >= ' ' && c <= '~' ? c : '?';
  return shown + (text.size() > kLongest ? "...'" : "'");
}

/// Cuts the text before the next `separator` off `text`.
std::string_view takeUpTo(char separator, std::string_view& text) {
  const std::size_t end = std::min(text.find(separator), text.size());
  const std::string_view part = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  return part;
}

bool isHeader(std::string_view text) {
  std::string squeezed(text);
  std::erase_if(squeezed, [](char c) { return c == ' ' || c == '\t'; });
  return squeezed == kHeader;
}

Result<double> parseNumber(std::string_view text, std::string_view column) {
  std::string_view digits = text;
  if (digits.size() > 1 && digits[0] == '+' && digits[1] != '-') digits.remove_prefix(1);
  double number = 0.0;
  const auto [rest, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  if (error == std::errc::invalid_argument || rest != digits.data() + digits.size())
    return fail(fmt::format("{} is {}, not a number", column, quoted(text)));
  if (error == std::errc::result_out_of_range || !std::isfinite(number))
    return fail(fmt::format("{} is {}, not a finite number in the range of a double", column, quoted(text)));
  return number;
}

}  // namespace

Result<HandTrajectory::Row> HandTrajectory::parseRow(std::string_view text) {
  const auto fields = static_cast<std::size_t>(std::count(text.begin(), text.end(), ',')) + 1;
  if (fields != kColumns.size())
    return fail(fmt::format("{} fields, expected {}: {}", fields, kColumns.size(), kHeader));
  std::array<double, kColumns.size()> v{};
  for (std::size_t i = 0; i < v.size(); ++i) {
    const auto number = parseNumber(trimmed(takeUpTo(',', text)), kColumns[i]);
    if (!number) return tl::unexpected(number.error());
    v[i] = *number;
  }
  const Quaternion q_WH(v[4], v[5], v[6], v[7]);
  if (!(std::abs(q_WH.norm() - 1.0) <= kUnitTolerance))
    return fail(
        fmt::format("the quaternion's length is {:.4g}, expected 1 within {}", q_WH.norm(), kUnitTolerance));
  return Row{v[0], Pose(Vector3(v[1], v[2], v[3]), q_WH.normalized()), 0};
}

Result<HandTrajectory> HandTrajectory::parse(std::string_view text, const std::string& file) {
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  HandTrajectory trajectory;
  std::vector<Row>& rows = trajectory.rows_;
  std::size_t line = 0;
  bool has_header = false;
  const auto failHere = [&](std::string_view what) {
    return fail(fmt::format("{}:{}: {}", file, line, what));
  };
  while (!text.empty()) {
    const std::string_view content = trimmed(takeUpTo('\n', text));
    ++line;
    if (content.empty()) continue;
    if (!has_header) {
      has_header = isHeader(content);
      if (!has_header)
        return failHere(fmt::format("expected the header {}, found {}", kHeader, quoted(content)));
      continue;
    }
    auto row = parseRow(content);
    if (!row) return failHere(row.error().what);
    row->line = line;
    if (!rows.empty() && !(row->t > rows.back().t))
      return failHere(
          fmt::format("t is {}, not after the {} of line {}", row->t, rows.back().t, rows.back().line));
    rows.push_back(*row);
  }
  line = std::max<std::size_t>(line, 1);
  if (!has_header) return failHere(fmt::format("empty, expected the header {} and a row", kHeader));
  if (rows.empty()) return failHere("no row after the header, expected at least one");
  return trajectory;
}

Result<HandTrajectory> HandTrajectory::read(const std::filesystem::path& file) {
  const std::string name = file.string();
  std::error_code unknown;
  if (std::filesystem::is_directory(file, unknown)) return fail(name + ": is a folder, expected a CSV file");
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return fail(name + ": cannot be read");
  // not by its size: a pipe has none
  std::string text;
  std::array<char, 65536> chunk{};
  while (stream.read(chunk.data(), chunk.size()), stream.gcount() > 0) {
    text.append(chunk.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > kLargestFile) return fail(name + ": larger than 256 MB, expected fewer rows");
  }
  if (stream.bad()) return fail(name + ": cannot be read");
  return parse(text, name);
}

const HandTrajectory::Row& HandTrajectory::rowAt(double t) const noexcept {
  const auto after = std::upper_bound(rows_.begin(), rows_.end(), t,
                                      [](double time, const Row& row) { return time < row.t; });
  return after == rows_.begin() ? *after : *(after - 1);
}

Pose HandTrajectory::poseAt(double t) const noexcept {
  const Row& from = rowAt(t);
  if (t <= from.t || &from == &rows_.back()) return from.X_WH;
  const Row& to = *(&from + 1);
  const double fraction = (t - from.t) / (to.t - from.t);
  const Displacement motion = displacement(from.X_WH, to.X_WH);
  return displaced(from.X_WH, {motion.translation * fraction, motion.rotation * fraction});
}

}  // namespace tenon::station
