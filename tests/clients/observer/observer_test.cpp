#include "clients/observer/observer.h"

#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/clients/observer/memory_file.h"

namespace tenon::observer {
namespace {

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

TEST(Observer, PrintsSentencesAfterTheyWaited) {
  MemoryFile output;
  Observer observer({.language = "de", .out = output.file()});
  observer.receive(mountStep());
  EXPECT_EQ(output.text(), "");
  observer.printAll();
  EXPECT_EQ(output.text(),
            "  12.00 s  step 2 of 15: Gitter einsetzen\n"
            "  12.00 s    the trainee is told: Von vorn einschieben.\n");
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
