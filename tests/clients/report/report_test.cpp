#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "clients/report/chart.h"
#include "clients/report/page.h"
#include "clients/report/session_story.h"
#include "clients/report/summary.h"
#include "tests/clients/report/made_recording.h"

namespace tenon {
namespace {

using testing::HasSubstr;
using testing::Not;

class ReportTest : public ::testing::Test {
 protected:
  ~ReportTest() override { std::filesystem::remove(file_); }
  SessionStory tell(const test::MadeSession& made = {}) {
    test::MadeRecording(file_, made);
    auto story = readStory(file_);
    EXPECT_TRUE(story);
    return *story;
  }

  std::filesystem::path file_ =
      std::filesystem::temp_directory_path() / ("report_" + std::to_string(getpid()) + ".mcap");
};

TEST_F(ReportTest, TellsEachStepWithItsTimes) {
  const SessionStory story = tell();
  ASSERT_EQ(story.visits.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_DOUBLE_EQ(story.visits[i].begin, 2.0 * static_cast<double>(i));
    EXPECT_DOUBLE_EQ(story.visits[i].end, 2.0 * static_cast<double>(i + 1));
    EXPECT_EQ(story.visits[i].phase, StepPhase::kDone);
    EXPECT_NEAR(story.visits[i].figures.contact_seconds, 1.0, 0.04);
  }
  EXPECT_TRUE(story.succeeded());
  EXPECT_EQ(story.visits[0].title, "Take the control box");
  EXPECT_DOUBLE_EQ(story.duration, 8.0);
}

TEST_F(ReportTest, AForceOfOneTickIsThePeakOfItsStepAndOfNoOther) {
  const SessionStory story = tell({.peak_force = 40.0});
  EXPECT_DOUBLE_EQ(story.visits[3].figures.peak_force, 40.0);
  EXPECT_DOUBLE_EQ(story.whole.peak_force, 40.0);
  EXPECT_LT(story.visits[2].figures.peak_force, 14.0);
}

TEST_F(ReportTest, GapAndDepthAreTwoFigures) {
  const SessionStory story = tell({.peak_force = 40.0});
  EXPECT_NEAR(story.whole.gap, 40.0 / 1000.0, 1e-12);  // the coupling's stretch
  EXPECT_GT(story.whole.depth, 0.0004);
  EXPECT_LT(story.whole.depth, 0.0006);
}

TEST_F(ReportTest, TheMeanForceIsOfTheTimeInContact) {
  const SessionStory story = tell();
  // half a sine of 12 N while touching; the idle half of the step does not count
  EXPECT_NEAR(story.visits[0].figures.mean_force, 12.0 * 2.0 / 3.14159, 0.4);
}

TEST_F(ReportTest, TellsHowTheMachineKeptUp) {
  const SessionStory story = tell();
  EXPECT_EQ(story.late_ticks, 2U);
  EXPECT_NEAR(story.compute_worst, 7.2e-3, 1e-3);
  EXPECT_LT(story.compute_median, 1e-3);
  ASSERT_EQ(story.force_ages.size(), 1U);
  EXPECT_EQ(story.force_ages[0].who, "Grace");
  EXPECT_THAT(summaryText(story), HasSubstr("late ticks        2"));
}

TEST_F(ReportTest, TheInstructorsHelpIsAnAid) {
  const SessionStory story = tell();
  ASSERT_EQ(story.aids.size(), 1U);
  EXPECT_THAT(story.aids[0], HasSubstr("instructor's cube in contact"));
  EXPECT_FALSE(story.instructor_force.empty());
}

TEST_F(ReportTest, ARunThatFailedDidNotSucceed) {
  const SessionStory story = tell({.succeeds = false});
  EXPECT_FALSE(story.succeeded());
  EXPECT_EQ(story.visits.back().phase, StepPhase::kTimedOut);
  EXPECT_EQ(outcomeOf(story), "failed");
}

TEST_F(ReportTest, ARunWithASkippedStepDidNotSucceed) {
  const SessionStory story = tell({.skips_a_step = true});
  EXPECT_FALSE(story.succeeded());
  EXPECT_EQ(story.visits[0].phase, StepPhase::kSkipped);
  EXPECT_EQ(outcomeOf(story), "not every step was done");
}

TEST_F(ReportTest, ARecordingThatWasCutIsToldAsFarAsItGoesAndSaysSo) {
  tell();
  std::filesystem::resize_file(file_, std::filesystem::file_size(file_) * 2 / 3);
  const auto story = readStory(file_);
  ASSERT_TRUE(story) << story.error().what;
  EXPECT_FALSE(story->succeeded());
  EXPECT_THAT(story->problem, HasSubstr("was cut"));
  EXPECT_THAT(reportPage(*story, ""), HasSubstr("was cut"));
}

TEST_F(ReportTest, WhatIsNoRecordingIsOneSentence) {
  std::ofstream(file_) << "not a recording";
  const auto story = readStory(file_);
  ASSERT_FALSE(story);
  EXPECT_THAT(story.error().what, HasSubstr("is not a recording"));
}

TEST_F(ReportTest, ThePageNeedsNothingElseAndShowsTextAsText) {
  const std::string page = reportPage(tell(), "");
  EXPECT_THAT(page, HasSubstr("Engine &lt;bay&gt;"));
  EXPECT_THAT(page, Not(HasSubstr("<script")));
  EXPECT_THAT(page, Not(HasSubstr("http")));
  EXPECT_THAT(page, Not(HasSubstr("<img")));
  for (const char* diagram : {"Force", "Penetration", "Load", "Computation time"})
    EXPECT_THAT(page, HasSubstr("aria-label=\"" + std::string(diagram) + " over time\""));
}

TEST_F(ReportTest, ThePictureOfTheSceneIsShownWhenThereIsOne) {
  EXPECT_THAT(reportPage(tell(), "scene.png"), HasSubstr("<img src=\"scene.png\""));
}

TEST_F(ReportTest, TheSummaryForProgramsSaysTheSame) {
  const auto summary = summaryJson(tell());
  EXPECT_EQ(summary["succeeded"], true);
  EXPECT_EQ(summary["steps"].size(), 4U);
  EXPECT_DOUBLE_EQ(summary["steps"][3]["peak_force"].get<double>(), 18.0);
  EXPECT_EQ(summary["final_hash"], "000000000000feed");
}

TEST_F(ReportTest, ASafetyLayerThatActsOftenIsOneLineAndOneMark) {
  SessionStory story = tell();
  for (int i = 0; i < 50; ++i)
    story.events.push_back({3.0 + 0.1 * i, Severity::kWarning, "safety", "acts " + std::to_string(i)});
  const std::string page = reportPage(story, "");
  EXPECT_THAT(page, HasSubstr("acts 0 (and 49 more until 7.9 s)"));
  EXPECT_THAT(page, Not(HasSubstr("acts 1")));
}

// An hour at 1 kHz in a diagram a thousand columns wide: 3,600 values a column, one of them a spike.
TEST(Chart, APeakOfOneSampleSurvivesAnHour) {
  Series series;
  for (int i = 0; i < 3'600'000; ++i) series.push_back({i * 1e-3, i == 1'234'567 ? 100.0 : 1.0});
  const std::string svg = drawChart({"Force", "N", {{"f", "c1", &series}}}, 3600.0, {}, {});
  EXPECT_THAT(svg, HasSubstr("V46.0"));  // the top of the diagram
  EXPECT_LT(svg.size(), 60'000U);
}

TEST(Chart, WithoutDataItIsAnEmptyDiagram) {
  const Series none;
  EXPECT_THAT(drawChart({"Force", "N", {{"f", "c1", &none}}}, 0.0, {}, {}), HasSubstr("</svg>"));
}

TEST(Chart, WhatIsAboveTheCutIsCountedInTheLegend) {
  const Series series{{0.0, 1.0}, {0.5, 9.0}, {1.0, 1.0}};
  const std::string svg = drawChart({"T", "ms", {{"t", "c1", &series}}, 0.0, "", 1.0, 4.0}, 1.0, {}, {});
  EXPECT_THAT(svg, HasSubstr("t (1 above, up to 9)"));
}

}  // namespace
}  // namespace tenon
