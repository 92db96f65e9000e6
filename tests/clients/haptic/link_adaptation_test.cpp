#include "clients/haptic/link_adaptation.h"

#include "tests/clients/haptic/joined_station.h"

namespace tenon::haptic {
namespace {

/// A station with a copy of the scene.
class LinkAdaptationTest : public JoinedStation {
 protected:
  /// After a second at whose end `overruns` cycles of the servo loop have been late since it began.
  ForceModelKind modelAfter(std::uint64_t overruns) {
    Telemetry telemetry;
    telemetry.loop_overruns = overruns;
    adaptation_->measure(telemetry, false);
    return adaptation_->chooseModel(true);
  }
  void SetUp() override {
    JoinedStation::SetUp();
    adaptation_.emplace(*link_, ForceModelWish::kSceneCopy);
  }

  std::optional<LinkAdaptation> adaptation_;
};

TEST_F(LinkAdaptationTest, AStationWhoseLoopBeginsAnewKeepsItsCopyOfTheScene) {
  EXPECT_EQ(modelAfter(40), ForceModelKind::kSceneCopy);
  EXPECT_EQ(modelAfter(3), ForceModelKind::kSceneCopy) << "after a restart of the server";
  EXPECT_EQ(modelAfter(3 + ForceModelChooser::kMostLate), ForceModelKind::kSceneCopy);
}

TEST_F(LinkAdaptationTest, AStationThatIsTooSlowGoesWithoutItsCopyAlsoWhenItsLoopIsNew) {
  EXPECT_EQ(modelAfter(1000), ForceModelKind::kSceneCopy) << "late before it had the copy";
  EXPECT_EQ(modelAfter(ForceModelChooser::kMostLate + 1), ForceModelKind::kManifold);
}

}  // namespace
}  // namespace tenon::haptic
