#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <unistd.h>

#include "idl/types/cache_folder.h"
#include "tests/bench/stability/stability_result.h"

namespace tenon::bench {
namespace {

struct Arguments {
  std::filesystem::path cache = defaultCache();
  std::uint64_t seed = 1;
  std::vector<Tick> delays{0, 1, 5, 25, 50, 100};
  std::vector<std::string> only, models, losses;
  std::string json, plot;
};

bool save(const std::string& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  return static_cast<bool>(out.flush());
}

template <class Item, class NameOf>
void keep(std::vector<Item>& items, const std::vector<std::string>& names, NameOf nameOf) {
  if (names.empty()) return;
  std::erase_if(items, [&](const Item& item) {
    return std::find(names.begin(), names.end(), nameOf(item)) == names.end();
  });
}

Result<void> measureAll(const Arguments& arguments) {
  auto situations = makeSituations(arguments.cache);
  if (!situations) return fail(situations.error().what);
  keep(*situations, arguments.only, [](const RigSituation& one) { return one.name; });
  std::vector<RigModel> models = rigModels();
  keep(models, arguments.models, [](RigModel one) { return std::string(nameOf(one)); });
  std::vector<RigLoss> losses = rigLosses();
  keep(losses, arguments.losses, [](const RigLoss& one) { return one.name; });

  StabilityRig rig(arguments.seed);
  std::vector<RigCell> cells;
  const bool is_terminal = isatty(STDERR_FILENO) == 1;
  for (const RigSituation& situation : *situations)
    for (const RigModel model : models)
      for (const Tick delay : arguments.delays)
        for (const RigLoss& loss : losses) {
          if (is_terminal)
            fmt::print(stderr, "\r\033[K{}, {}, {} ms, {} ...", situation.title, nameOf(model), delay,
                       loss.name);
          const auto cell = rig.measure(situation, model, delay, loss);
          if (!cell) return fail(cell.error().what);
          cells.push_back(*cell);
        }
  if (is_terminal) fmt::print(stderr, "\r\033[K");
  const std::vector<Table> tables = stabilityTables(*situations, cells);
  for (const Table& table : tables) fmt::print("{}\n", toText(table));
  if (!arguments.json.empty() && !save(arguments.json, stabilityJson(arguments.seed, tables).dump(1) + "\n"))
    return fail(arguments.json + ": cannot be written");
  if (!arguments.plot.empty() && !save(arguments.plot, stabilityPlot(*situations, cells)))
    return fail(arguments.plot + ": cannot be written");
  return {};
}

int run(int argc, char** argv) {
  CLI::App app("Stability and felt force of a hand over networks, by a simulated device, link and session",
               "tenon bench stability");
  Arguments arguments;
  app.add_option("--seed", arguments.seed, "of links and devices; equal seeds give equal bytes")
      ->capture_default_str();
  app.add_option("--delay", arguments.delays, "one-way delays [ms]")
      ->delimiter(',')
      ->check(CLI::Range(0, 500));
  app.add_option("--situation", arguments.only,
                 "only these: wall, corner, peg, moving, two_people, free_part")
      ->delimiter(',')
      ->check(CLI::IsMember({"wall", "corner", "peg", "moving", "two_people", "free_part"}));
  std::vector<std::string> models, losses;
  for (const RigModel model : rigModels()) models.emplace_back(nameOf(model));
  for (const RigLoss& loss : rigLosses()) losses.push_back(loss.name);
  app.add_option("--model", arguments.models, "only these force models")
      ->delimiter(',')
      ->check(CLI::IsMember(models));
  app.add_option("--loss", arguments.losses, "only these losses")
      ->delimiter(',')
      ->check(CLI::IsMember(losses));
  app.add_option("--json", arguments.json, "writes the tables as JSON to this file");
  app.add_option("--plot", arguments.plot, "writes the diagrams as SVG to this file");
  app.add_option("--cache", arguments.cache, "folder of baked structures")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (const auto done = measureAll(arguments); !done) {
    fmt::print(stderr, "tenon bench stability: {}\n", done.error().what);
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace tenon::bench

int main(int argc, char** argv) { return tenon::bench::run(argc, argv); }
