#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "clients/report/chart.h"
#include "clients/report/page.h"
#include "clients/report/session_analysis.h"
#include "clients/report/summary.h"
#include "tests/clients/report/synthetic_recording.h"

namespace tenon::report {
namespace {

using testing::HasSubstr;
using testing::Not;

class ReportTest : public ::testing::Test {
 protected:
  ~ReportTest() override { std::filesystem::remove(file_); }
  SessionAnalysis analyze(const test::SyntheticSession& session = {}) {
    test::SyntheticRecording(file_, session);
    auto analysis = analyzeRecording(file_);
    EXPECT_TRUE(analysis);
    return *analysis;
  }

  std::filesystem::path file_ =
      std::filesystem::temp_directory_path() / ("report_" + std::to_string(getpid()) + ".mcap");
};

TEST_F(ReportTest, HasEveryStepWithItsTimes) {
  const SessionAnalysis analysis = analyze();
  ASSERT_EQ(analysis.visits.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_DOUBLE_EQ(analysis.visits[i].begin, 2.0 * static_cast<double>(i));
    EXPECT_DOUBLE_EQ(analysis.visits[i].end, 2.0 * static_cast<double>(i + 1));
    EXPECT_EQ(analysis.visits[i].phase, StepPhase::kDone);
    EXPECT_NEAR(analysis.visits[i].metrics.contact_seconds, 1.0, 0.04);
  }
  EXPECT_TRUE(analysis.succeeded());
  EXPECT_EQ(analysis.visits[0].title, "Take the control box");
  EXPECT_DOUBLE_EQ(analysis.duration, 8.0);
}

TEST_F(ReportTest, AForceOfOneTickIsThePeakOfItsStepOnly) {
  const SessionAnalysis analysis = analyze({.peak_force = 40.0});
  EXPECT_FLOAT_EQ(analysis.visits[3].metrics.peak_force, 20.0);
  EXPECT_FLOAT_EQ(analysis.whole.peak_force, 20.0);
  EXPECT_LT(analysis.visits[2].metrics.peak_force, 7.0);
}

TEST_F(ReportTest, GapAndDepthAreSeparateMetrics) {
  const SessionAnalysis analysis = analyze({.peak_force = 40.0});
  EXPECT_NEAR(analysis.whole.gap, 40.0 / 1000.0, 1e-12);  // extension of the coupling
  EXPECT_GT(analysis.whole.depth, 0.0004);
  EXPECT_LT(analysis.whole.depth, 0.0006);
}

TEST_F(ReportTest, MeanForceIsTakenOverTheTimeInContact) {
  const SessionAnalysis analysis = analyze();
  // half a sine of 12 N while touching; the idle half of the step does not count
  EXPECT_NEAR(analysis.visits[0].metrics.mean_force, 0.5 * 12.0 * 2.0 / 3.14159, 0.3);
}

TEST_F(ReportTest, WhileTheServerHoldsThePartStillThereIsNoForceAndNoGap) {
  const SessionAnalysis analysis = analyze({.skips_a_step = true});
  EXPECT_LT(analysis.whole.peak_force, 10.0) << "the coupling pulls with 248 N then";
  EXPECT_LT(analysis.whole.gap, 0.02) << "it is 248 mm then";
}

TEST_F(ReportTest, EachStepHasItsErrorPathAndCollisions) {
  const SessionAnalysis analysis = analyze();
  for (const StepVisit& visit : analysis.visits) {
    EXPECT_NEAR(visit.path, 1.0, 0.02);
    EXPECT_EQ(visit.collisions, 1);
    EXPECT_NEAR(visit.error.position, 0.001, 0.002);
    EXPECT_DOUBLE_EQ(visit.tolerance.position, 0.002);
  }
  EXPECT_NEAR(analysis.path, 4.0, 0.08);
  EXPECT_THAT(summaryText(analysis), HasSubstr(" of 2.0 "));
}

TEST_F(ReportTest, FiguresDoNotDependOnTheOrderInWhichTopicsArrive) {
  nlohmann::json by_tick = summaryJson(analyze());
  nlohmann::json by_topic = summaryJson(analyze({.arrives_by_topic = true}));
  for (nlohmann::json* summary : {&by_tick, &by_topic}) summary->erase("began_ns");
  EXPECT_GT(by_tick["whole"]["mean_force"], 1.0);
  EXPECT_EQ(by_tick.dump(1), by_topic.dump(1));
}

TEST_F(ReportTest, HasTheRealTimePerformance) {
  const SessionAnalysis analysis = analyze();
  EXPECT_EQ(analysis.late_ticks, 2U);
  EXPECT_NEAR(analysis.compute_worst, 7.2e-3, 1e-3);
  EXPECT_LT(analysis.compute_median, 1e-3);
  ASSERT_EQ(analysis.force_latencies.size(), 1U);
  EXPECT_EQ(analysis.force_latencies[0].who, "Grace");
  EXPECT_THAT(summaryText(analysis), HasSubstr("late ticks        2"));
}

TEST_F(ReportTest, HelpOfTheInstructorIsListedAsAnAid) {
  const SessionAnalysis analysis = analyze();
  ASSERT_EQ(analysis.aids.size(), 1U);
  EXPECT_THAT(analysis.aids[0], HasSubstr("instructor's pointer in contact"));
  EXPECT_FALSE(analysis.instructor_force.empty());
}

TEST_F(ReportTest, TakingAHandsOwnPointerIsNoEvent) {
  const SessionAnalysis analysis = analyze();
  for (const SessionEvent& event : analysis.events) EXPECT_NE(event.kind, "taken") << event.text;
}

TEST_F(ReportTest, AFailedRunDidNotSucceed) {
  const SessionAnalysis analysis = analyze({.succeeds = false});
  EXPECT_FALSE(analysis.succeeded());
  EXPECT_EQ(analysis.visits.back().phase, StepPhase::kTimedOut);
  EXPECT_EQ(outcomeOf(analysis), "failed");
}

// left by `goto`: no message says how it ended, and the log has no "step done" of it
TEST_F(ReportTest, AStepThatWasLeftByACommandIsNotDone) {
  const SessionAnalysis analysis = analyze({.leaves_a_step = true});
  EXPECT_EQ(analysis.visits[1].phase, StepPhase::kWaiting);
  EXPECT_EQ(analysis.visits[2].phase, StepPhase::kDone);
  EXPECT_FALSE(analysis.succeeded());
  EXPECT_THAT(analysis.aids, ::testing::Contains("led to a step"));
  EXPECT_THAT(analysis.aids, Not(::testing::Contains("step skipped"))) << "that was refused";
}

TEST_F(ReportTest, ARunWithASkippedStepDidNotSucceed) {
  const SessionAnalysis analysis = analyze({.skips_a_step = true});
  EXPECT_FALSE(analysis.succeeded());
  EXPECT_EQ(analysis.visits[0].phase, StepPhase::kSkipped);
  EXPECT_EQ(outcomeOf(analysis), "not every step was done");
}

TEST_F(ReportTest, ATruncatedRecordingIsAnalysedAsFarAsItGoes) {
  analyze();
  std::filesystem::resize_file(file_, std::filesystem::file_size(file_) * 2 / 3);
  const auto analysis = analyzeRecording(file_);
  ASSERT_TRUE(analysis) << analysis.error().what;
  EXPECT_FALSE(analysis->succeeded());
  EXPECT_THAT(analysis->problem, HasSubstr("is truncated"));
  EXPECT_THAT(reportPage(*analysis, ""), HasSubstr("is truncated"));
}

TEST_F(ReportTest, AFileThatIsNoRecordingFailsWithASentence) {
  std::ofstream(file_) << "not a recording";
  const auto analysis = analyzeRecording(file_);
  ASSERT_FALSE(analysis);
  EXPECT_THAT(analysis.error().what, HasSubstr("is not a recording"));
}

TEST_F(ReportTest, ThePageIsSelfContainedAndEscapesText) {
  const std::string page = reportPage(analyze(), "");
  EXPECT_THAT(page, HasSubstr("Engine &lt;bay&gt;"));
  EXPECT_THAT(page, Not(HasSubstr("<script")));
  EXPECT_THAT(page, Not(HasSubstr("http")));
  EXPECT_THAT(page, Not(HasSubstr("<img")));
  for (const char* chart : {"Force", "Gap and overlap", "Computational load", "Computation time"})
    EXPECT_THAT(page, HasSubstr("aria-label=\"" + std::string(chart) + " over time\""));
}

TEST_F(ReportTest, ThePageShowsAPictureOfTheSceneIfGiven) {
  EXPECT_THAT(reportPage(analyze(), "scene.png"), HasSubstr("<img src=\"scene.png\""));
}

TEST_F(ReportTest, TheJsonSummaryHasTheSameValues) {
  const auto summary = summaryJson(analyze());
  EXPECT_EQ(summary["succeeded"], true);
  EXPECT_EQ(summary["steps"].size(), 4U);
  EXPECT_DOUBLE_EQ(summary["steps"][3]["peak_force"].get<double>(), 9.0);
  EXPECT_EQ(summary["final_hash"], "000000000000feed");
}

TEST_F(ReportTest, RepeatedSafetyEventsAreOneLineAndOneMark) {
  SessionAnalysis analysis = analyze();
  for (int i = 0; i < 50; ++i)
    analysis.events.push_back({3.0 + 0.1 * i, Severity::kWarning, "safety", "acts " + std::to_string(i)});
  const std::string page = reportPage(analysis, "");
  EXPECT_THAT(page, HasSubstr("acts 0 (and 49 more until 7.9 s)"));
  EXPECT_THAT(page, Not(HasSubstr("acts 1")));
}

// An hour at 1 kHz in a chart a thousand columns wide: 3,600 values per column, one of them a spike.
TEST(Chart, APeakOfOneSampleIsDrawnInAnHourOfData) {
  Series series;
  for (int i = 0; i < 3'600'000; ++i) series.push_back({i * 1e-3, i == 1'234'567 ? 100.0 : 1.0});
  const std::string svg = drawChart({"Force", "N", {{"f", "c1", &series}}}, 3600.0, {}, {});
  EXPECT_THAT(svg, HasSubstr("V46.0"));  // the top of the chart
  EXPECT_LT(svg.size(), 60'000U);
}

TEST(Chart, WithoutDataItIsEmpty) {
  const Series none;
  EXPECT_THAT(drawChart({"Force", "N", {{"f", "c1", &none}}}, 0.0, {}, {}), HasSubstr("</svg>"));
}

TEST(Chart, ValuesAboveTheCutAreCountedInTheLegend) {
  const Series series{{0.0, 1.0}, {0.5, 9.0}, {1.0, 1.0}};
  const std::string svg = drawChart({"T", "ms", {{"t", "c1", &series}}, 0.0, "", 1.0, 4.0}, 1.0, {}, {});
  EXPECT_THAT(svg, HasSubstr("t (1 above, up to 9)"));
}

}  // namespace
}  // namespace tenon::report
