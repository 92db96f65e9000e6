#include "tests/bench/stability/stability_result.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include <fmt/format.h>

namespace tenon::bench {
namespace {

struct ModelName {
  RigModel model;
  std::string_view name, color;
};
constexpr std::array kModels{ModelName{RigModel::kStreamed, "streamed", "#c0392b"},
                             ModelName{RigModel::kStreamedPassive, "streamed_passive", "#e08e0b"},
                             ModelName{RigModel::kManifold, "manifold", "#2f6fd0"},
                             ModelName{RigModel::kSceneCopy, "scene_copy", "#1e8449"}};

// ---- the diagram: [px]
constexpr double kWidth = 300.0, kHeight = 160.0, kLeft = 60.0, kTop = 50.0, kGapX = 90.0, kGapY = 70.0;

/// A diagram of one number over the delay, on a logarithmic scale.
struct Diagram {
  std::string title;
  double least, most;                            // any unit, of the axis
  std::function<double(const RigCell&)> number;  // NaN: none
  bool worst_is_least;
};

std::string line(double x0, double y0, double x1, double y1, const char* color) {
  return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\"/>\n", x0,
                     y0, x1, y1, color);
}
std::string label(double x, double y, const std::string& text, const char* anchor,
                  std::string_view color = "#333") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" fill=\"{}\">{}</text>\n", x, y,
                     anchor, color, text);
}

std::string draw(const Diagram& diagram, const std::string& situation, const std::vector<RigCell>& cells,
                 const std::vector<Tick>& delays, double left, double top) {
  const auto x = [&](std::size_t i) {
    return left + kWidth * (static_cast<double>(i) + 0.5) / static_cast<double>(delays.size());
  };
  const double span = std::log10(diagram.most / diagram.least);
  const auto y = [&](double number) {
    const double clamped = std::clamp(number, diagram.least, diagram.most);
    return top + kHeight * (1.0 - std::log10(clamped / diagram.least) / span);
  };
  std::string svg = label(left, top - 8.0, diagram.title, "start");
  for (double tick = diagram.least; tick <= 1.0001 * diagram.most; tick *= 10.0) {
    svg += line(left, y(tick), left + kWidth, y(tick), "#ddd");
    svg += label(left - 6.0, y(tick) + 4.0, fmt::format("{:g}", tick), "end");
  }
  for (std::size_t i = 0; i < delays.size(); ++i)
    svg += label(x(i), top + kHeight + 16.0, fmt::format("{} ms", delays[i]), "middle");
  for (const ModelName& model : kModels) {
    std::string points;
    for (std::size_t i = 0; i < delays.size(); ++i) {
      std::vector<double> numbers;
      for (const RigCell& cell : cells)
        if (cell.situation == situation && cell.model == model.model && cell.delay == delays[i])
          numbers.push_back(diagram.number(cell));
      if (numbers.empty() || std::isnan(numbers.front())) continue;
      const auto [least, most] = std::minmax_element(numbers.begin(), numbers.end());
      points += fmt::format("{:.1f},{:.1f} ", x(i), y(diagram.worst_is_least ? *least : *most));
    }
    if (!points.empty())
      svg += fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"/>\n", points,
                         model.color);
  }
  return svg;
}

std::vector<Tick> delaysOf(const std::vector<RigCell>& cells) {
  std::vector<Tick> delays;
  for (const RigCell& cell : cells) delays.push_back(cell.delay);
  std::sort(delays.begin(), delays.end());
  delays.erase(std::unique(delays.begin(), delays.end()), delays.end());
  return delays;
}

}  // namespace

std::string_view nameOf(RigModel model) {
  return std::find_if(kModels.begin(), kModels.end(),
                      [&](const ModelName& one) { return one.model == model; })
      ->name;
}

std::vector<RigModel> rigModels() {
  std::vector<RigModel> models;
  for (const ModelName& one : kModels) models.push_back(one.model);
  return models;
}

std::vector<RigLoss> rigLosses() {
  return {{.name = "0"},
          {.name = "2%", .share = 0.02},
          {.name = "10%", .share = 0.1},
          {.name = "bursts", .share = 0.02, .burst = 20}};
}

std::vector<Table> stabilityTables(const std::vector<RigSituation>& situations,
                                   const std::vector<RigCell>& cells) {
  std::vector<Table> tables;
  for (const RigSituation& situation : situations) {
    Table table{.name = situation.name, .title = "stability: " + situation.title};
    table.columns = {"model",      "delay [ms]",  "loss",      "stable K [N/m]", "tip [mm]",
                     "ripple [N]", "energy [mJ]", "force [N]", "error [%]",      "peak error [N]"};
    if (situation.hands.size() > 1) {
      table.columns.emplace_back("coupling [N/m]");
      table.columns.emplace_back("deflection [mm]");
      table.columns.emplace_back("share of the other's [%]");
    }
    for (const RigCell& cell : cells) {
      if (cell.situation != situation.name) continue;
      std::vector<TableCell> row{std::string(nameOf(cell.model)), static_cast<double>(cell.delay), cell.loss};
      const auto held = [&](double number) { return cell.judged ? TableCell(number) : TableCell::none(); };
      row.push_back(cell.stiffness ? TableCell(*cell.stiffness)
                    : cell.judged  ? TableCell("none")
                                   : TableCell::none());
      row.insert(row.end(), {held(1e3 * cell.tip), held(cell.ripple), held(1e3 * cell.energy),
                             held(cell.mean_force), 100.0 * cell.mean_error, cell.peak_error});
      if (situation.hands.size() > 1) {
        row.push_back(held(cell.coupling));
        row.push_back(held(1e3 * cell.mean_force / std::max(1.0, cell.coupling)));
        row.push_back(held(100.0 * cell.other_share));
      }
      table.rows.push_back(std::move(row));
    }
    table.notes = {
        fmt::format(
            "stable K: largest of {:.0f} N/m (what the device renders passively) and its parts by powers of "
            "sqrt 2, down to 1/64, with which the held contact is stable;",
            fullStiffness()),
        "  stable: tip < 0.5 mm peak to peak and force < 0.2 N RMS above 5 Hz, over its last 2 s.",
        "tip, ripple, energy given to the hand, force: at full stiffness. error, peak error: force beside "
        "that of the",
        "  manifold model without delay, on the same path of the device, RMS in % and largest."};
    tables.push_back(std::move(table));
  }
  return tables;
}

nlohmann::json stabilityJson(std::uint64_t seed, const std::vector<Table>& tables) {
  nlohmann::json all = nlohmann::json::array();
  for (const Table& table : tables) all.push_back(toJson(table));
  return {{"seed", seed},
          {"device", "sigma.7 (simulated)"},
          {"full_stiffness", fullStiffness()},
          {"tables", all}};
}

std::string stabilityPlot(const std::vector<RigSituation>& situations, const std::vector<RigCell>& cells) {
  const std::vector<Tick> delays = delaysOf(cells);
  const double nan = std::nan("");
  const std::array diagrams{
      Diagram{"largest stable stiffness [N/m]", 10.0, 10'000.0,
              [&](const RigCell& cell) { return cell.judged ? cell.stiffness.value_or(10.0) : nan; }, true},
      Diagram{"error of the felt force [%]", 0.01, 1000.0,
              [](const RigCell& cell) { return 100.0 * cell.mean_error; }, false}};
  const double width = kLeft + 2.0 * (kWidth + kGapX);
  const double height = kTop + static_cast<double>(situations.size()) * (kHeight + kGapY);
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" "
      "height=\"{1:.0f}\" "
      "font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n",
      width, height);
  double x = kLeft;
  for (const ModelName& model : kModels) {
    svg += label(x, 16.0, std::string(model.name), "start", model.color);
    x += 130.0;
  }
  for (std::size_t row = 0; row < situations.size(); ++row) {
    const double top = kTop + static_cast<double>(row) * (kHeight + kGapY);
    for (std::size_t column = 0; column < diagrams.size(); ++column) {
      Diagram diagram = diagrams[column];
      diagram.title = situations[row].title + ": " + diagram.title;
      svg += draw(diagram, situations[row].name, cells, delays,
                  kLeft + static_cast<double>(column) * (kWidth + kGapX), top);
    }
  }
  return svg + "</svg>\n";
}

}  // namespace tenon::bench
