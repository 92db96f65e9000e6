#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <unistd.h>

#include "clients/report/page.h"
#include "clients/report/page_data.h"
#include "idl/types/cache_folder.h"
#include "idl/types/number_range.h"
#include "idl/types/output_files.h"
#include "server/session/scene_loader.h"
#include "tests/bench/engine/bench_scene.h"
#include "tests/bench/engine/corner_path.h"
#include "tests/bench/engine/feature_table.h"
#include "tests/bench/engine/heap_table.h"
#include "tests/bench/engine/insertion.h"
#include "tests/bench/engine/methods.h"
#include "tests/bench/engine/overload_table.h"
#include "tests/bench/engine/query_table.h"
#include "tests/bench/engine/server_tick_table.h"
#include "tests/bench/engine/tick_table.h"
#include "tests/bench/engine/truth_table.h"

namespace tenon::bench {
namespace {

struct BenchArguments {
  std::string benchmark;
  double detail = 1.0;
  int rounds = 5;
  std::size_t ticks = 100'000;
  std::vector<std::string> only;
  std::string json;
  std::string figures;
  bool overwrite = false;
  std::filesystem::path cache = defaultCache();
  std::string scenario;
};

int reportError(const std::string& what) {
  std::fprintf(stderr, "tenon bench: %s\n", what.c_str());
  return 1;
}

/// On a terminal prints a line that the next output overwrites; elsewhere prints nothing.
void printProgress(std::string_view step) {
  static const bool kIsTerminal = isatty(STDERR_FILENO) == 1;
  if (kIsTerminal) fmt::print(stderr, "\r\033[K{} ...", step);
}
void clearProgress() {
  if (isatty(STDERR_FILENO) == 1) fmt::print(stderr, "\r\033[K");
}

std::string processor() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "unknown processor";
}

double loadAverage() {
  double load[1] = {0.0};
  return getloadavg(load, 1) == 1 ? load[0] : 0.0;
}

bool save(const std::string& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  return static_cast<bool>(out.flush());
}

class Bench {
 public:
  explicit Bench(const BenchArguments& arguments)
      : arguments_(arguments), only_(arguments.only.begin(), arguments.only.end()) {}

  Result<void> run() {
    machine_ = fmt::format("{}, {} threads, load {:.1f} at the start", processor(),
                           sysconf(_SC_NPROCESSORS_ONLN), loadAverage());
    fmt::print("{}; parts at detail {}\n\n", machine_, arguments_.detail);
    if (auto done = sceneTables(); !done) return fail(done.error().what);
    if (wants("methods")) add(methodsTable(printProgress));
    if (wants("many_bodies")) add(manyBodiesTable(printProgress));
    if (wants("heaps")) add(heapsTable(printProgress));
    if (wants("overload")) add(overloadTable(printProgress));
    if (!arguments_.json.empty() && !save(arguments_.json, json().dump(2) + "\n"))
      return fail(arguments_.json + ": cannot be written");
    return {};
  }

 private:
  /// The tables of the shipped engine bay, with the structures and options of a session.
  Result<void> sceneTables() {
    const auto wantsAny = [this](auto... tables) { return (wants(tables) || ...); };
    if (!wantsAny("bake", "query", "truth", "server_ticks", "insertion", "both_sides")) return {};
    std::filesystem::path cache = arguments_.cache;
    if (wants("bake")) {
      cache /= "bench";
      if (const auto error = add(bakeTable(arguments_.scenario, cache, arguments_.detail, printProgress)))
        return fail(*error);
    }
    printProgress("loading the engine bay");
    const auto loaded =
        session::loadScene(arguments_.scenario, {.cache = cache, .detail = arguments_.detail});
    if (!loaded) return fail(loaded.error().what);
    if (wants("query") || wants("truth")) {
      const auto pair = makePair(*loaded, arguments_.detail, printProgress);
      if (!pair) return fail(pair.error().what);
      if (wants("query")) add(queryTable(*pair, arguments_.rounds, printProgress));
      if (wants("truth")) add(truthTable(*pair, arguments_.rounds, printProgress));
    }
    if (wants("server_ticks"))
      if (const auto error = add(serverTickTable(*loaded, arguments_.ticks, printProgress)))
        return fail(*error);
    if (wants("both_sides"))
      if (const auto error = add(featureTable(*loaded, arguments_.rounds, printProgress)))
        return fail(*error);
    if (wants("insertion")) {
      const auto insertion = rehearseInsertion(*loaded, printProgress);
      if (!insertion) return fail(insertion.error().what);
      add(insertion->table);
      if (!arguments_.figures.empty()) {
        const auto page = report::readReportPage(report::defaultReportPage());
        if (!page) return fail(page.error().what);
        nlohmann::json data = report::pageData(insertion->analysis);
        data["no_player"] = "a benchmark makes no recording";
        if (!save(arguments_.figures, report::reportPage(*page, data, nullptr)))
          return fail(arguments_.figures + ": cannot be written");
      }
    }
    return {};
  }

  [[nodiscard]] bool wants(const std::string& table) const { return only_.empty() || only_.contains(table); }

  void add(const Table& table) {
    clearProgress();
    fmt::print("{}\n", toText(table));
    std::fflush(stdout);
    tables_.push_back(toJson(table));
  }

  /// Adds a table that could be made; else why it could not.
  std::optional<std::string> add(const Result<Table>& table) {
    if (!table) return table.error().what;
    add(*table);
    return std::nullopt;
  }

  [[nodiscard]] nlohmann::json json() const {
    return {{"machine", machine_}, {"detail", arguments_.detail}, {"tables", tables_}};
  }

  const BenchArguments& arguments_;
  std::set<std::string> only_;
  std::string machine_;
  nlohmann::json tables_ = nlohmann::json::array();
};

int run(int argc, char** argv) {
  BenchArguments arguments;
  CLI::App app(
      "Measures the performance of Tenon on this machine, compared with other engines and simpler methods in "
      "one run.",
      "tenon bench");
  app.set_help_flag("-h,--help", "what this program does and how to call it");
  app.add_option("benchmark", arguments.benchmark,
                 "engine: measure the collision and force engine; corner: path of a held box in a corner, as "
                 "CSV")
      ->required()
      ->check(CLI::IsMember({"engine", "corner"}));
  app.add_option("--scenario", arguments.scenario, "folder of the engine bay's scenario");
  app.add_option("--detail", arguments.detail,
                 "level of detail of the generated parts, 0 to 1; 1 is the paper's scene")
      ->check(tenon::numberFrom(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--rounds", arguments.rounds, "number of queries per pose; the smallest time counts")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--only", arguments.only,
                 "tables to produce: bake, query, truth, server_ticks, both_sides, insertion, methods, "
                 "many_bodies, heaps, overload (default: all)")
      ->check(CLI::IsMember({"bake", "query", "truth", "server_ticks", "both_sides", "insertion", "methods",
                             "many_bodies", "heaps", "overload"}));
  app.add_option("--ticks", arguments.ticks, "number of server ticks to measure at least")
      ->check(CLI::Range(1, 10'000'000))
      ->capture_default_str();
  app.add_option("--json", arguments.json, "write the tables to this file as JSON");
  app.add_option("--figures", arguments.figures,
                 "write a report page with force, penetration, load and computation time of the insertion");
  app.add_flag("--overwrite", arguments.overwrite, kOverwriteHelp);
  app.add_option("--cache", arguments.cache, "folder for generated parts and haptic structures")
      ->option_text("DIR");
  app.footer(
      "Times are comparable only within one run, on an otherwise idle machine.\n"
      "Exit codes: 0 all tables were produced, 1 error (the reason is on stderr), 2 wrong usage.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (const auto refusal =
          refuseOutputs({.outputs = {arguments.json, arguments.figures}, .overwrite = arguments.overwrite})) {
    reportError(refusal->what);
    return refusal->exit_code;
  }
  if (arguments.benchmark == "corner") {
    fmt::print("{}", cornerPath());
    return 0;
  }
  if (arguments.scenario.empty()) {
    const char* share = std::getenv("TENON_SHARE");
    arguments.scenario = std::string(share != nullptr ? share : ".") + "/scenarios/engine_bay";
  }
  const auto done = Bench(arguments).run();
  clearProgress();
  return done ? 0 : reportError(done.error().what);
}

}  // namespace
}  // namespace tenon::bench

int main(int argc, char** argv) {
  try {
    return tenon::bench::run(argc, argv);
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "tenon bench: %s\n", problem.what());
    return 1;
  }
}
