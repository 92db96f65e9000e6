#include "clients/report/page.h"

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <span>
#include <sstream>

#include <fmt/format.h>

namespace tenon::report {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kTitlePlace = "<title>Tenon</title>";
constexpr std::string_view kDataPlace = "<!-- data -->";

void replaceAll(std::string& text, std::string_view what, std::string_view with) {
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + with.size()))
    text.replace(at, what.size(), with);
}

std::string escaped(std::string text) {
  replaceAll(text, "&", "&amp;");
  replaceAll(text, "<", "&lt;");
  return text;
}

/// JSON in which no tag of HTML can begin or end.
std::string dumped(const nlohmann::json& data) {
  // texts in a recording may be invalid UTF-8
  std::string text = data.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  replaceAll(text, "<", "\\u003c");
  return text;
}

std::string base64(std::span<const std::uint8_t> bytes) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t at = 0; at < bytes.size(); at += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - at);
    std::uint32_t word = 0;
    for (std::size_t i = 0; i < 3; ++i) word = word << 8U | (i < count ? bytes[at + i] : 0U);
    for (std::size_t i = 0; i < 4; ++i) text += i <= count ? kDigits[word >> (18 - 6 * i) & 63U] : '=';
  }
  return text;
}

void addBlock(std::string& html, std::string_view type, std::string_view name, std::string_view text) {
  html += fmt::format("<script type=\"{}\" data-name=\"{}\">{}</script>\n", type, name, text);
}

}  // namespace

fs::path defaultReportPage() {
  std::error_code error;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  for (const char* beside : {"../report_page/report.html", "../../share/tenon/report_page/report.html"})
    if (fs::exists(folder / beside, error)) return (folder / beside).lexically_normal();
  return (folder / "../report_page/report.html").lexically_normal();
}

Result<std::string> readReportPage(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  Result<std::string> page(text.str());
  if (page->find(kTitlePlace) == std::string::npos || page->find(kDataPlace) == std::string::npos)
    return fail(file.string() +
                ": the report's page is not built, which needs Node 18 or newer: `deploy/setup console`, "
                "`cmake --preset release`, `cmake --build --preset release --target console_page`");
  return page;
}

std::size_t sessionBudget(std::string_view page, const nlohmann::json& data) {
  constexpr std::size_t kTags = 20'000;  // of blocks, and what is added to the data
  const std::size_t used = page.size() + dumped(data).size() + kTags;
  return used >= kMaxReportBytes ? 0 : (kMaxReportBytes - used) / 4 * 3;  // in base64
}

std::string reportPage(std::string_view page, const nlohmann::json& data, const EmbeddedSession* session) {
  const nlohmann::json& summary = data.at("summary");
  const std::string title = summary.value("title", "");
  std::string blocks;
  addBlock(blocks, "application/json", "report", dumped(data));
  if (session != nullptr) {
    addBlock(blocks, "text/plain", "recording", base64(session->recording));
    for (const auto& [name, bytes] : session->assets) addBlock(blocks, "text/plain", name, base64(bytes));
  }
  std::string html(page);
  html.replace(html.find(kDataPlace), kDataPlace.size(), blocks);
  html.replace(html.find(kTitlePlace), kTitlePlace.size(),
               "<title>" + escaped(title.empty() ? "Session " + summary.value("session", "") : title) +
                   ": report</title>");
  return html;
}

}  // namespace tenon::report
