#include "clients/observer/observer.h"

#include <cstdlib>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace tenon::observer {
namespace {

/// Memory file that an observer prints to.
class MemoryFile {
 public:
  MemoryFile() : file_(open_memstream(&text_, &size_)) {}
  ~MemoryFile() {
    std::fclose(file_);
    std::free(text_);
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
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

TEST(Observer, PrintsAStepOnceInTheLanguageOfTheOptions) {
  MemoryFile output;
  Observer observer({.language = "de", .out = output.file()});
  observer.receive(mountStep());
  observer.receive(mountStep());
  EXPECT_EQ(output.text(),
            "  12.00 s  step 2/15  Gitter einsetzen: active\n           Von vorn einschieben.\n");
}

TEST(Observer, PrintsTheBeginOfAContactWithTheTitlesOfBothObjects) {
  MemoryFile output;
  Observer observer({.out = output.file()});
  SceneObject grid, bay;
  grid.object = ObjectId{1};
  grid.title = "grid";
  bay.object = ObjectId{0};
  bay.name = "engine_bay";
  observer.receive(grid);
  observer.receive(bay);
  ContactPairs pairs;
  pairs.tick = 1500;
  PairContact pair;
  pair.a = grid.object;
  pair.b = bay.object;
  pair.colliding = true;
  pairs.pairs.push_back(pair);
  observer.receive(pairs);
  observer.receive(pairs);
  EXPECT_EQ(output.text(), "   1.50 s    grid touches engine_bay\n");
}

TEST(Observer, PrintsNoGrabOfAPointerAndNoReasonOfSuccess) {
  MemoryFile output;
  Observer observer({.out = output.file()});
  SceneObject pointer;
  pointer.object = ObjectId{2};
  pointer.title = "Your right hand";
  pointer.kind = "pointer";
  observer.receive(pointer);
  EventLog taken;
  taken.tick = 1000;
  taken.kind = "taken";
  taken.text = "Your right hand (right hand)";
  observer.receive(taken);
  taken.text = "Grid (right hand)";
  observer.receive(taken);
  RunState run;
  run.tick = 2000;
  run.phase = RunPhase::kSucceeded;
  run.reason = "all steps done";
  observer.receive(run);
  EXPECT_EQ(output.text(), "   1.00 s    taken: Grid (right hand)\n   2.00 s  session succeeded\n");
}

TEST(Observer, PrintsOneJsonObjectPerLine) {
  MemoryFile output;
  Observer observer({.json = true, .out = output.file()});
  observer.receive(mountStep());
  RunState run;
  run.phase = RunPhase::kFailed;
  run.reason = "a step was not done in time";
  observer.receive(run);
  std::istringstream lines(output.text());
  std::string line;
  std::vector<std::string> kinds;
  while (std::getline(lines, line)) kinds.push_back(nlohmann::json::parse(line).at("kind"));
  EXPECT_EQ(kinds, (std::vector<std::string>{"step", "run"}));
}

TEST(Observer, IsOverWithTheRunAndItsExitCodeIsTheOutcome) {
  MemoryFile output;
  Observer observer({.out = output.file()});
  EXPECT_FALSE(observer.over());
  RunState run;
  run.phase = RunPhase::kRunning;
  observer.receive(run);
  EXPECT_FALSE(observer.over());
  run.phase = RunPhase::kFailed;
  observer.receive(run);
  EXPECT_TRUE(observer.over());
  EXPECT_EQ(observer.exitCode(), 1);
  run.phase = RunPhase::kSucceeded;
  observer.receive(run);
  EXPECT_EQ(observer.exitCode(), 0);
}

}  // namespace
}  // namespace tenon::observer
