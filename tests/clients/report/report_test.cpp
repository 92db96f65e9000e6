#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "clients/report/embedded_session.h"
#include "clients/report/event_list.h"
#include "clients/report/page.h"
#include "clients/report/page_data.h"
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

TEST_F(ReportTest, TheTimeOfAStepHasNoPauses) {
  const SessionAnalysis analysis = analyze({.pauses = true});
  ASSERT_EQ(analysis.visits.size(), 4U);
  EXPECT_NEAR(analysis.visits[0].seconds, 2.0, 1e-9);
  EXPECT_NEAR(analysis.visits[1].seconds, 1.5, 1e-9);
  EXPECT_NEAR(analysis.visits[2].seconds, 2.0, 1e-9);
  EXPECT_NEAR(analysis.visits[1].end - analysis.visits[1].begin, 2.0, 1e-9);
  const nlohmann::json summary = summaryJson(analysis);
  EXPECT_NEAR(summary["steps"][1]["seconds"].get<double>(), 1.5, 1e-9);
  EXPECT_NEAR(summary["steps"][1]["end"].get<double>(), 4.0, 1e-9);
  EXPECT_THAT(summaryText(analysis), HasSubstr("without pauses"));
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
  for (const char* line :
       {"late ticks        2", "writes to the bus 3 took more than 5 ms, 4 samples not sent",
        "max 11.0 ms, longest silence 13.0 ms (Grace)", "held still after 80 ms of silence at most"})
    EXPECT_THAT(summaryText(analysis), HasSubstr(line));
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
  EXPECT_THAT(analysis.aids, Not(::testing::Contains("exercise reset"))) << "that was dropped";
}

TEST_F(ReportTest, ARunWithASkippedStepDidNotSucceed) {
  const SessionAnalysis analysis = analyze({.skips_a_step = true});
  EXPECT_FALSE(analysis.succeeded());
  EXPECT_EQ(analysis.visits[0].phase, StepPhase::kSkipped);
  EXPECT_EQ(outcomeOf(analysis), "not every step was done");
}

TEST_F(ReportTest, AStepWhoseEndIsNotRecordedIsWhatTheLogSaysOrNotKnown) {
  const SessionAnalysis by_log = analyze({.leaves_no_end = true, .skip_is_in_the_log = true});
  EXPECT_EQ(by_log.visits[0].phase, StepPhase::kSkipped);
  EXPECT_EQ(resultOf(by_log.visits[0]), "skipped");
  EXPECT_FALSE(by_log.succeeded());
  const SessionAnalysis unknown = analyze({.leaves_no_end = true});
  EXPECT_EQ(resultOf(unknown.visits[0]), "not known");
  EXPECT_EQ(summaryJson(unknown)["steps"][0]["phase"], "not known");
  EXPECT_FALSE(unknown.succeeded());
  EXPECT_EQ(resultOf(unknown.visits[1]), "done");
}

TEST_F(ReportTest, FiguresOfStreamsThatAreMissingAreLeftBlankAndThatIsSaidAtTheTop) {
  const SessionAnalysis whole = analyze();
  EXPECT_TRUE(whole.missing.empty()) << whole.problem;
  const SessionAnalysis analysis =
      analyze({.lost = {"HandManifold", "ContactPairs_100", "WorldFrame_100", "StepProgress"},
               .states_losses = true});
  const std::string text = summaryText(analysis);
  EXPECT_THAT(text.substr(0, text.find("\n\n")), HasSubstr("samples are missing: "));
  for (const char* const count :
       {"7900 of 8000 of TickInput", "200 of 800 of WorldFrame_100", "of HandManifold"})
    EXPECT_THAT(analysis.problem, HasSubstr(count));
  EXPECT_THAT(analysis.problem, Not(HasSubstr("GrabState"))) << "all of them are there";
  const nlohmann::json summary = nlohmann::json::parse(summaryJson(analysis).dump());
  for (const char* const figure : {"peak_force", "mean_force", "contact_seconds", "path", "collisions",
                                   "position_error", "angle_error", "device_proxy_gap", "field_depth"}) {
    EXPECT_TRUE(summary["steps"][1][figure].is_null()) << figure;
    EXPECT_FALSE(summary["steps"][2][figure].is_null()) << figure;
  }
  EXPECT_EQ(errorText(analysis.visits[1]), "");
  EXPECT_TRUE(summary["whole"]["peak_force"].is_null());
  EXPECT_FALSE(summary["steps"][1]["load_percent"].is_null()) << "that is of another stream";
}

// of them nobody counts how many there were
TEST_F(ReportTest, ForcesThatStationsDidNotStateAreLeftBlank) {
  const nlohmann::json summary =
      nlohmann::json::parse(summaryJson(analyze({.lost = {"HandState_100"}})).dump());
  EXPECT_TRUE(summary["steps"][1]["peak_force"].is_null());
  EXPECT_TRUE(summary["steps"][1]["mean_force"].is_null());
  EXPECT_FALSE(summary["steps"][0]["peak_force"].is_null());
  EXPECT_FALSE(summary["steps"][1]["path"].is_null());
}

TEST_F(ReportTest, ATruncatedRecordingIsAnalysedAsFarAsItGoes) {
  analyze();
  std::filesystem::resize_file(file_, std::filesystem::file_size(file_) * 2 / 3);
  const auto analysis = analyzeRecording(file_);
  ASSERT_TRUE(analysis) << analysis.error().what;
  EXPECT_FALSE(analysis->succeeded());
  EXPECT_THAT(analysis->problem, HasSubstr("is truncated"));
  EXPECT_THAT(pageData(*analysis)["summary"]["problem"].get<std::string>(), HasSubstr("is truncated"));
  EXPECT_TRUE(embedSession(file_, "/nonexistent", kMaxReportBytes)) << "what can be read is played";
}

TEST_F(ReportTest, AFileThatIsNoRecordingFailsWithASentence) {
  std::ofstream(file_) << "not a recording";
  const auto analysis = analyzeRecording(file_);
  ASSERT_FALSE(analysis);
  EXPECT_THAT(analysis.error().what, HasSubstr("is not a recording"));
}

TEST_F(ReportTest, AJournalAndAForeignFileAreNamedAsWhatTheyAre) {
  const auto refusalOf = [&](const char* topic, const char* type) {
    auto writer = record::McapWriter::open(file_);
    const std::uint8_t byte = 0;
    EXPECT_TRUE(writer->write(writer->addChannel(topic, type, ""), 1, 0, {&byte, 1}));
    EXPECT_TRUE(writer->close());
    const auto analysis = analyzeRecording(file_);
    return analysis ? "" : analysis.error().what;
  };
  EXPECT_THAT(
      refusalOf("TickInput", "tenon::TickInputPart"),
      AllOf(HasSubstr(file_.string() + ": is the journal of a server"), HasSubstr("tenon resimulate")));
  EXPECT_THAT(refusalOf("/scan", "sensor_msgs/msg/LaserScan"), HasSubstr("is no recording of a session"));
  EXPECT_EQ(refusalOf("EventLog", "tenon::EventLog"), "") << "what a recorder that was killed soon has";
}

constexpr std::string_view kPage = "<title>Tenon</title><style></style><!-- data --><script>code</script>";

TEST_F(ReportTest, NoTextOfASessionCanEndItsBlockInThePage) {
  nlohmann::json data = pageData(analyze());
  data["events"][0]["text"] = "</script><script>alert(1)</script><!--";
  const std::string page = reportPage(kPage, data, nullptr);
  EXPECT_THAT(page, HasSubstr("<title>Engine &lt;bay>: report</title>"));
  EXPECT_THAT(page, HasSubstr("Engine \\u003cbay>"));
  EXPECT_THAT(page, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(page, Not(HasSubstr("<!--")));
}

TEST_F(ReportTest, ThePlayersSessionIsInThePageAndSmall) {
  const nlohmann::json data = pageData(analyze());
  const auto session = embedSession(file_, "/nonexistent", sessionBudget(kPage, data));
  ASSERT_TRUE(session) << session.error().what;
  EXPECT_NEAR(session->rate, 30.0, 1.0);
  EXPECT_EQ(session->objects, 2U);
  EXPECT_EQ(session->models, 0U) << "they are not in that cache";
  EXPECT_LT(session->recording.size(), std::filesystem::file_size(file_) / 2);
  EXPECT_THAT(reportPage(kPage, data, &*session), HasSubstr("data-name=\"recording\">iU1DQVA"));
}

TEST_F(ReportTest, WhatIsPlayedFitsWithFewerPosesASecond) {
  analyze({.ticks_per_step = 20'000});
  const auto all = embedSession(file_, "/nonexistent", kMaxReportBytes);
  ASSERT_TRUE(all);
  const auto few = embedSession(file_, "/nonexistent", all->recording.size() / 2);
  ASSERT_TRUE(few) << few.error().what;
  EXPECT_LE(few->recording.size(), all->recording.size() / 2);
  EXPECT_LT(few->rate, all->rate);
  EXPECT_FALSE(embedSession(file_, "/nonexistent", 10));
}

TEST_F(ReportTest, ThePageThatIsNotBuiltIsNamed) {
  const auto page = readReportPage("/nonexistent/report.html");
  ASSERT_FALSE(page);
  EXPECT_THAT(page.error().what, HasSubstr("/nonexistent/report.html: the report's page is not built"));
  EXPECT_THAT(page.error().what, HasSubstr("deploy/setup console"));
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
  const nlohmann::json data = pageData(analysis);
  int rows = 0;
  for (const nlohmann::json& event : data["events"]) {
    if (event["kind"] != "safety") continue;
    ++rows;
    EXPECT_EQ(event["text"], "acts 0");
    EXPECT_EQ(event["more"], 49);
    EXPECT_NEAR(event["until"].get<double>(), 7.9, 1e-9);
  }
  EXPECT_EQ(rows, 1);
}

TEST_F(ReportTest, AnEntryOfAStationIsCountedAsOftenAsItSays) {
  const std::map<std::string, int> others = otherEvents(analyze().events);
  EXPECT_EQ(others.at("station"), 29);
  EXPECT_EQ(others.at("device"), 1) << "it is told again to those that come late";
}

// An hour at 1 kHz in a few thousand values, one of them a spike.
TEST(PageData, APeakOfOneSampleIsInThePlotOfAnHour) {
  SessionAnalysis analysis;
  analysis.duration = 3600.0;
  for (int i = 0; i < 3'600'000; ++i)
    analysis.trainee_force.push_back({i * 1e-3, i == 1'234'567 ? 100.0 : 1.0});
  const nlohmann::json plots = pageData(analysis)["plots"];
  const nlohmann::json& force = plots["series"]["trainee_force"];
  ASSERT_LE(force.size(), kMaxColumns);
  EXPECT_EQ(force[static_cast<std::size_t>(1234.567 / plots["seconds"].get<double>())], 100.0);
  EXPECT_FALSE(plots["series"].contains("instructor_force"));
}

TEST(PageData, WithoutDataItHasNoSeries) {
  const nlohmann::json plots = pageData({})["plots"];
  EXPECT_TRUE(plots["series"].empty());
  EXPECT_EQ(plots["count"], 1);
}

TEST(PageData, ComputationTimesAboveThePlotAreCounted) {
  SessionAnalysis analysis;
  analysis.duration = 1.0;
  analysis.compute_max = {{0.0, 1e-3}, {0.5, 9e-3}, {1.0, 1e-3}};
  analysis.compute_worst = 9e-3;
  const nlohmann::json cut = pageData(analysis)["plots"]["compute_cut"];
  EXPECT_EQ(cut["above"], 1);
  EXPECT_EQ(cut["largest"], 9e-3);
}

}  // namespace
}  // namespace tenon::report
