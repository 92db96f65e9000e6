#include "clients/observer/observer.h"

#include <cstdlib>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace tenon {
namespace {

/// What an observer wrote, line by line.
class Page {
 public:
  Page() : file_(open_memstream(&text_, &size_)) {}
  ~Page() {
    std::fclose(file_);
    std::free(text_);
  }
  Page(const Page&) = delete;
  Page& operator=(const Page&) = delete;
  std::FILE* file() { return file_; }
  std::string text() {
    std::fflush(file_);
    return {text_, size_};
  }

 private:
  char* text_ = nullptr;
  std::size_t size_ = 0;
  std::FILE* file_;
};

StepState mountStep() {
  StepState step;
  step.revision = 3;
  step.step = 1;
  step.steps = 15;
  step.name = "mount_grid";
  step.phase = StepPhase::kActive;
  step.has_target = true;
  step.title = {{"en", "Mount the grid"}, {"de", "Gitter einsetzen"}};
  step.instruction = {{"en", "Slide it in from the front."}, {"de", "Von vorn einschieben."}};
  step.started = 12000;
  return step;
}

TEST(Observer, TellsAStepInTheLanguageAskedForAndOnce) {
  Page page;
  Observer observer({.language = "de", .out = page.file()});
  observer.hear(mountStep());
  observer.hear(mountStep());
  EXPECT_EQ(page.text(),
            "  12.00 s  step 2/15  Gitter einsetzen: active\n           Von vorn einschieben.\n");
}

TEST(Observer, TellsWhenTwoThingsBeginToTouchByTheirTitles) {
  Page page;
  Observer observer({.out = page.file()});
  SceneObject grid, bay;
  grid.object = ObjectId{1};
  grid.title = "grid";
  bay.object = ObjectId{0};
  bay.name = "engine_bay";
  observer.hear(grid);
  observer.hear(bay);
  ContactPairs pairs;
  pairs.tick = 1500;
  PairContact pair;
  pair.a = grid.object;
  pair.b = bay.object;
  pair.colliding = true;
  pairs.pairs.push_back(pair);
  observer.hear(pairs);
  observer.hear(pairs);
  EXPECT_EQ(page.text(), "   1.50 s    grid touches engine_bay\n");
}

TEST(Observer, WritesAJsonObjectALine) {
  Page page;
  Observer observer({.json = true, .out = page.file()});
  observer.hear(mountStep());
  RunState run;
  run.phase = RunPhase::kFailed;
  run.reason = "a step was not done in time";
  observer.hear(run);
  std::istringstream lines(page.text());
  std::string line;
  std::vector<std::string> kinds;
  while (std::getline(lines, line)) kinds.push_back(nlohmann::json::parse(line).at("kind"));
  EXPECT_EQ(kinds, (std::vector<std::string>{"step", "run"}));
}

TEST(Observer, EndsWithTheRunAndSaysByItsExitCodeHowItWent) {
  Page page;
  Observer observer({.out = page.file()});
  EXPECT_FALSE(observer.over());
  RunState run;
  run.phase = RunPhase::kRunning;
  observer.hear(run);
  EXPECT_FALSE(observer.over());
  run.phase = RunPhase::kFailed;
  observer.hear(run);
  EXPECT_TRUE(observer.over());
  EXPECT_EQ(observer.exitCode(), 1);
  run.phase = RunPhase::kSucceeded;
  observer.hear(run);
  EXPECT_EQ(observer.exitCode(), 0);
}

}  // namespace
}  // namespace tenon
