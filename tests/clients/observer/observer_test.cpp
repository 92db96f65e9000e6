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

// A name in Latin-1: \xfc is u umlaut there, and no UTF-8.
TEST(Observer, PrintsTextsThatAreNotUtf8AsJsonAllTheSame) {
  MemoryFile output;
  Observer observer({.json = true, .out = output.file()});
  const std::string latin = "J\xfcrg", replaced = "J\xef\xbf\xbdrg";
  Presence presence;
  presence.client = ClientId(1);
  presence.name = latin;
  presence.alive = true;
  observer.receive(presence);
  observer.receive(EventLog{.kind = "note", .text = latin + ": hallo"});
  observer.receive(EmergencyStop{.client_guid = "a", .counter = 1, .who = latin, .reason = latin});
  observer.receive(EmergencyClear{.client_guid = "a", .counter = 1, .who = latin, .reason = latin});
  RunState run;
  run.phase = RunPhase::kFailed;
  run.reason = latin;
  observer.receive(run);
  std::istringstream lines(output.text());
  std::string line;
  std::vector<std::string> texts;
  while (std::getline(lines, line))
    for (const char* key : {"name", "text", "who", "reason"})
      if (const auto json = nlohmann::json::parse(line); json.contains(key)) texts.push_back(json.at(key));
  EXPECT_EQ(texts, (std::vector<std::string>{replaced, replaced + ": hallo", replaced, replaced, replaced,
                                             replaced, replaced}));
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
