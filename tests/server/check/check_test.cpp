#include "server/check/check.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/check/checked_scene.h"
#include "server/structures/shell_builder.h"
#include "tests/server/game_control/scenario_fixture.h"

namespace tenon::check {
namespace {

using game_control::ScenarioFile;
using test::smallScenario;
using test::smallStructures;
using test::with;
using ::testing::HasSubstr;
using ::testing::Not;

ScenarioFile parsed(const std::string& text) {
  return game_control::parseScenario(text, "small/scenario.yaml").value();
}

std::vector<Finding> findingsIn(const std::string& text, std::vector<test::StructuresPtr> structures) {
  const ScenarioFile scenario = parsed(text);
  const auto scene = game_control::makeScene(scenario, std::move(structures));
  if (!scene) {
    ADD_FAILURE() << scene.error().what;
    return {};
  }
  return checkScene(scenario, **scene, {});
}

/// The only error or warning; fails when there is none, or another one.
Finding theOnlyProblem(const std::vector<Finding>& findings) {
  std::vector<Finding> problems;
  std::copy_if(findings.begin(), findings.end(), std::back_inserter(problems),
               [](const Finding& finding) { return finding.severity != Severity::kInfo; });
  for (const Finding& problem : problems) SCOPED_TRACE(problem.text);
  EXPECT_EQ(problems.size(), 1U) << (problems.empty() ? ""
                                                      : problems.front().text + " | " + problems.back().text);
  return problems.empty() ? Finding{} : problems.front();
}

/// The small scenario's structures with a socket of `hole` [m].
std::vector<test::StructuresPtr> withSocket(const Vector3& hole, double voxel = 0.001) {
  std::vector<test::StructuresPtr> structures = smallStructures();
  structures[0] = test::socketStructures(hole, 0.02, voxel);
  return structures;
}

//   |  |_  _|
//   | |    | |  part of 40 mm in a socket of 44 x 44 x 42 mm, 2 mm above its bottom: when it turns by t, its
//   | |____| |  half width becomes 20 (sin t + cos t) = 22 mm at t = 6.06 deg
//   |________|
TEST(Check, APartThatFitsIsANoteWithItsPlayAndTilt) {
  const std::vector<Finding> findings = findingsIn(smallScenario(), smallStructures());
  ASSERT_EQ(findings.size(), 1U) << findings.back().text;
  const Finding& fit = findings.front();
  EXPECT_EQ(fit.kind, FindingKind::kClearance);
  EXPECT_EQ(fit.severity, Severity::kInfo);
  EXPECT_EQ(fit.state, "mount");
  EXPECT_EQ(fit.line, 16);
  EXPECT_NEAR(fit.value, 0.004, 40e-6);
  EXPECT_THAT(fit.text, HasSubstr("part has 4"));
  const auto tilt = fit.text.find("tilts by ");
  ASSERT_NE(tilt, std::string::npos) << fit.text;
  EXPECT_NEAR(std::stod(fit.text.substr(tilt + 9)), 2.0 * 6.06, 0.3) << fit.text;
}

TEST(Check, TheErrorOfAPlayIsStatedAndHolds) {
  constexpr double kVoxel = 0.001;
  for (const double play : {0.0004, 0.0007, 0.001, 0.0013, 0.0017, 0.0023, 0.0031}) {
    for (const double above_bottom : {0.0001, 0.0004, 0.0008, 0.0021}) {
      const double hole = 0.04 + play;
      const std::vector<Finding> findings =
          findingsIn(with(smallScenario(), "at: [0, 0, -20 mm]", "at: [0, 0, -21 mm]"),
                     withSocket(Vector3(hole, hole, 0.041 + above_bottom), kVoxel));
      ASSERT_EQ(findings.size(), 1U) << play << " " << above_bottom;
      EXPECT_EQ(findings[0].kind, FindingKind::kClearance);
      EXPECT_NEAR(findings[0].value, play, findings[0].error) << above_bottom;
      EXPECT_LE(findings[0].error, 0.6 * kVoxel);
    }
  }
}

TEST(Check, FilledSpacesAreNotesWithTheirSizeAndPlaceInTheWorld) {
  std::vector<test::StructuresPtr> structures = smallStructures();
  auto part = std::make_shared<structures::HapticStructures>(*structures[1]);
  for (const float size : {0.008F, 0.006F, 0.004F, 0.002F})
    part->info.filled.push_back({{0.0F, 0.0F, 0.0F}, {0.01F, 0.002F, size}, size});
  structures[1] = part;
  std::vector<Finding> filled = findingsIn(smallScenario(), structures);
  std::erase_if(filled, [](const Finding& finding) { return finding.kind != FindingKind::kFilled; });
  ASSERT_EQ(filled.size(), 3U) << "one by one";
  EXPECT_EQ(filled[0].severity, Severity::kInfo);
  EXPECT_EQ(filled[0].object, ObjectId{1});
  EXPECT_NEAR(filled[0].value, 0.01, 1e-6);
  EXPECT_THAT(filled[0].text, HasSubstr("a void or slot of 10 mm x 2 mm x 8 mm at ("));
  ASSERT_TRUE(filled[0].p_WP);
  EXPECT_NEAR((*filled[0].p_WP - Vector3(0.205, 0.001, 0.104)).norm(), 0.0, 1e-6) << "of the start";
  EXPECT_THAT(filled[0].text, Not(HasSubstr("more")));
  EXPECT_THAT(filled[2].text, HasSubstr("1 more have smaller walls"));
}

TEST(Check, AStatedClearanceThatIsNotTrueIsAWarningWithTheTrueOne) {
  const Finding more = theOnlyProblem(
      findingsIn(with(smallScenario(), "clearance: 4 mm", "clearance: 6 mm"), smallStructures()));
  EXPECT_EQ(more.kind, FindingKind::kClearance);
  EXPECT_EQ(more.severity, Severity::kWarning);
  EXPECT_NEAR(more.value, 0.004, 40e-6);
  EXPECT_THAT(more.hint, HasSubstr("clearance: 4 mm in line 11"));
  const Finding less = theOnlyProblem(
      findingsIn(with(smallScenario(), "clearance: 4 mm", "clearance: 2 mm"), smallStructures()));
  EXPECT_EQ(less.kind, FindingKind::kClearance);
  EXPECT_NEAR(less.value, 0.004, 40e-6);
}

TEST(Check, AMissingClearanceIsNamedWithThePlayAndWhereToWriteIt) {
  const std::string text = with(smallScenario(), "pairs:\n  - {between: [part, bay], clearance: 4 mm}\n", "");
  const Finding missing = theOnlyProblem(findingsIn(text, withSocket(Vector3(0.0412, 0.0412, 0.042), 0.002)));
  EXPECT_EQ(missing.kind, FindingKind::kClearance);
  EXPECT_NEAR(missing.value, 0.0012, missing.error);
  EXPECT_NEAR(missing.error, 0.0012, 1e-9) << "0.6 voxels";
  EXPECT_THAT(missing.text, HasSubstr("no clearance is stated"));
  EXPECT_THAT(missing.hint, HasSubstr("{between: [part, bay], clearance: "));
}

TEST(Check, AnOverlapAtTheStartIsFoundWithItsDepthPlaceAndAWayOut) {
  // the part's lower side is 3 mm below the upper end of the socket's wall, which is 22 to 42 mm from the
  // middle
  const std::string text = with(smallScenario(), "at: [0.2, 0, 0.1]", "at: [32 mm, 0, 17 mm]");
  const Finding overlap = theOnlyProblem(findingsIn(with(text, "status: hidden, ", ""), smallStructures()));
  EXPECT_EQ(overlap.kind, FindingKind::kOverlap);
  EXPECT_EQ(overlap.severity, Severity::kError);
  EXPECT_EQ(overlap.line, 4);
  EXPECT_TRUE(overlap.state.empty());
  EXPECT_NEAR(overlap.value, 0.003, 50e-6);
  EXPECT_THAT(overlap.text, HasSubstr("part is 3 mm inside bay at the start, at ("));
  ASSERT_TRUE(overlap.p_WP);
  EXPECT_NEAR(overlap.p_WP->z(), -0.003, 1e-4);
  EXPECT_GT(overlap.p_WP->x(), 0.022);
  EXPECT_THAT(overlap.hint, HasSubstr("it is free at [0.032, 0, 0.020"));
  EXPECT_EQ(countOf(findingsIn(text, smallStructures()), Severity::kError), 1U)
      << "also when it appears later";
}

TEST(Check, ATargetInAWallIsAnErrorAndOneWithinTheToleranceAWarning) {
  // 3 mm and 1.5 mm below the bottom of the socket, where 2 mm are tolerated
  const Finding deep = theOnlyProblem(
      findingsIn(with(smallScenario(), "at: [0, 0, -20 mm]", "at: [0, 0, -25 mm]"), smallStructures()));
  EXPECT_EQ(deep.kind, FindingKind::kOverlap);
  EXPECT_EQ(deep.severity, Severity::kError);
  EXPECT_NEAR(deep.value, 0.003, 20e-6);
  EXPECT_THAT(deep.text, HasSubstr("inside bay"));
  EXPECT_THAT(deep.hint, HasSubstr("it is free at [0, 0, -0.02")) << "2.2 mm above the bottom at most";
  ASSERT_TRUE(deep.p_WP);
  EXPECT_NEAR(deep.p_WP->z(), -0.045, 1e-4);
  const Finding shallow = theOnlyProblem(
      findingsIn(with(smallScenario(), "at: [0, 0, -20 mm]", "at: [0, 0, -23.5 mm]"), smallStructures()));
  EXPECT_EQ(shallow.severity, Severity::kWarning);
  EXPECT_NEAR(shallow.value, 0.0015, 20e-6);
}

//   |  |____|  |   a part of 42 mm above and in a hole of 40 mm: 1 mm in each wall, and 2 mm are tolerated
//   |__________|
TEST(Check, APartThatIsTooWideForItsHoleIsAnErrorThoughItsDepthIsTolerated) {
  const std::string text = with(smallScenario(), "clearance: 4 mm", "clearance: 1 mm");
  std::vector<test::StructuresPtr> structures = withSocket(Vector3(0.040, 0.040, 0.042), 0.0005);
  structures[1] = test::boxStructures(Vector3(0.042, 0.042, 0.040), 0.002, 0.003);
  const Finding wide = theOnlyProblem(findingsIn(text, structures));
  EXPECT_EQ(wide.kind, FindingKind::kOverlap);
  EXPECT_EQ(wide.severity, Severity::kError);
  EXPECT_NEAR(wide.value, 0.001414, 20e-6) << "at its edges";
  EXPECT_THAT(wide.text, HasSubstr("inside bay"));
  EXPECT_THAT(wide.text, HasSubstr("can never be there: it is free nowhere within 2 mm and 2 deg of it"));
  // in one direction alone
  structures[1] = test::boxStructures(Vector3(0.039, 0.042, 0.040), 0.002, 0.003);
  EXPECT_EQ(theOnlyProblem(findingsIn(text, structures)).severity, Severity::kError);
}

TEST(Check, ATargetThatIsTurnedInAWallIsReachableWhereTheTurnIsTolerated) {
  // 40 mm in 40.8 mm: free up to 1.15 deg
  std::vector<test::StructuresPtr> structures = withSocket(Vector3(0.0408, 0.0408, 0.042), 0.0005);
  structures[1] = test::boxStructures(Vector3::Constant(0.04), 0.002, 0.003);
  std::string text = with(smallScenario(), "clearance: 4 mm", "clearance: 0.8 mm");
  text = with(text, "at: [0, 0, -20 mm],", "at: [0, 0, -20 mm], turn: {axis: z, deg: 2.6},");
  const Finding turned = theOnlyProblem(findingsIn(text, structures));
  EXPECT_EQ(turned.kind, FindingKind::kOverlap);
  EXPECT_EQ(turned.severity, Severity::kWarning);
  EXPECT_THAT(turned.text, HasSubstr("2 mm are tolerated"));
}

/// The small scenario with a plate of 40 x 40 x 10 mm at `at`.
std::string withPlate(const std::string& at) {
  return with(
      smallScenario(), "hands:\n",
      "  - {name: plate, title: Plate, status: fixed, meshes: [{part: plate}], structures: {voxel: 2 mm}, "
      "start: {at: " +
          at + "}}\nhands:\n");
}

TEST(Check, ABlockedApproachNamesWhatBlocksItAndWhere) {
  std::vector<test::StructuresPtr> structures = smallStructures();
  structures.push_back(test::boxStructures(Vector3(0.04, 0.04, 0.01), 0.002, 0.005));
  // from 100 mm above its target down: its lower side meets the plate's upper side, z = 25 mm, 65 mm before
  const std::string from_afar = with(withPlate("[0, 0, 20 mm]"), "distance: 50 mm", "distance: 100 mm");
  const Finding blocked = theOnlyProblem(findingsIn(from_afar, structures));
  EXPECT_EQ(blocked.kind, FindingKind::kApproach);
  EXPECT_EQ(blocked.severity, Severity::kError);
  EXPECT_NEAR(blocked.value, 0.065, 0.002);
  EXPECT_THAT(blocked.text, HasSubstr("before its target by Plate, at ("));
  ASSERT_TRUE(blocked.p_WP);
  EXPECT_NEAR(blocked.p_WP->z(), 0.025, 0.001);
  // from 50 mm above it begins inside of the plate
  EXPECT_NEAR(theOnlyProblem(findingsIn(withPlate("[0, 0, 20 mm]"), structures)).value, 0.05, 1e-6);
  const std::vector<Finding> beside = findingsIn(withPlate("[100 mm, 0, 20 mm]"), structures);
  EXPECT_EQ(countOf(beside, Severity::kError) + countOf(beside, Severity::kWarning), 0U);
}

//      ____
//     |part|   a pin of the bay, thinner than the spacing of the part's points and than the voxels: its field
//   __   i  __ has no trace of it, its features have its tip 5 mm above the rim
//     |    |
TEST(Check, AnApproachIsBlockedByWhatBlocksItInASession) {
  std::vector<test::StructuresPtr> structures = smallStructures();
  auto bay = std::make_shared<structures::HapticStructures>(*structures[0]);
  const std::vector<structures::SurfaceSample> tip{{Vector3(0.01, 0.003, 0.005), -Vector3::UnitZ(), 0.0}};
  std::vector<std::uint32_t> order;
  structures::FeatureStorage features{structures::buildFlatShell(tip, 0.001, order), {}};
  features.edges.resize(1);
  bay->features = structures::makeFeatureShell(std::move(features));
  structures[0] = bay;
  const Finding blocked = theOnlyProblem(findingsIn(smallScenario(), structures));
  EXPECT_EQ(blocked.kind, FindingKind::kApproach);
  EXPECT_NEAR(blocked.value, 0.045, 0.0015);
  ASSERT_TRUE(blocked.p_WP);
  EXPECT_NEAR((*blocked.p_WP - Vector3(0.01, 0.003, 0.005)).norm(), 0.0, 1e-6);
}

//   |part|  lies on a plate and is pushed along it: by steps of a fraction of a voxel
TEST(ContactProbe, APathThatIsTooLongIsNotTakenForFree) {
  simulation::Scene scene;
  scene.objects.resize(2);
  scene.objects[0].structures = test::boxStructures(Vector3::Constant(0.02), 0.001, 0.005);
  scene.objects[1].structures = test::boxStructures({0.1, 0.1, 0.01}, 0.001, 0.005);
  scene.pairs.push_back({.a = ObjectId{0}, .b = ObjectId{1}});
  ContactProbe probe(scene, ObjectId{0});
  const PartObstacle plate{ObjectId{1}, 0, Pose(Vector3(0.0, 0.0, -0.005))};
  const double floor = 0.0;
  const auto around = [](double s) {
    return Pose(Vector3(0.02 * std::sin(s / 0.02), 0.02 * std::cos(s / 0.02), 0.01));
  };
  const auto travel = [&](double limit) {
    return probe.travel({&plate, 1}, {&floor, 1}, around, limit, ProbedSurface::kMesh, kFieldError);
  };
  EXPECT_TRUE(travel(0.1).complete);
  EXPECT_EQ(travel(0.1).length, 0.1);
  const PartTravel far = travel(10.0);
  EXPECT_FALSE(far.blocked);
  EXPECT_FALSE(far.complete);
  EXPECT_LT(far.length, 5.0);
}

TEST(Check, ATurnThatTheDeviceDoesNotHaveIsFound) {
  const Finding turn = theOnlyProblem(findingsIn(
      with(smallScenario(), "at: [0, 0, -20 mm],", "at: [0, 0, -20 mm], turn: {axis: z, deg: 180},"),
      smallStructures()));
  // it is hidden until it is touched: shown when it is taken, and not turned
  EXPECT_EQ(turn.kind, FindingKind::kTurning);
  EXPECT_EQ(turn.severity, Severity::kWarning) << "the hand may be turned the other way when it takes it";
  EXPECT_NEAR(turn.value, 3.14159, 1e-4);
  EXPECT_THAT(turn.text, HasSubstr("turned by 180 deg to its target, and hug-sim turns by 149 deg"));
  EXPECT_TRUE(std::ranges::none_of(
      findingsIn(
          with(smallScenario(), "at: [0, 0, -20 mm],", "at: [0, 0, -20 mm], turn: {axis: z, deg: 90},"),
          smallStructures()),
      [](const Finding& finding) { return finding.kind == FindingKind::kTurning; }));
}

TEST(Check, ATurnIsFoundAtThePartAndNotAtTheOriginOfItsMesh) {
  std::vector<test::StructuresPtr> structures = smallStructures();
  const Vector3 p_OC(0.3, 0.0, 0.0);
  std::vector<structures::SurfaceSample> samples = test::boxSamples(Vector3::Constant(0.04), 0.005);
  for (structures::SurfaceSample& sample : samples) sample.p_MP += p_OC;
  structures[1] = test::analyticStructures(
      test::movedDistance(test::boxDistance(Vector3::Constant(0.04)), Pose(p_OC)),
      Eigen::AlignedBox3d(p_OC - Vector3::Constant(0.02), p_OC + Vector3::Constant(0.02)), 0.002, samples,
      0.005);
  // turned by 180 deg about z, the part is at -p_OC from its origin: in the socket
  const std::vector<Finding> findings = findingsIn(
      with(smallScenario(), "at: [0, 0, -20 mm],", "at: [0.3, 0, -20 mm], turn: {axis: z, deg: 180},"),
      structures);
  const auto turn = std::ranges::find(findings, FindingKind::kTurning, &Finding::kind);
  ASSERT_NE(turn, findings.end());
  ASSERT_TRUE(turn->p_WP);
  EXPECT_NEAR((*turn->p_WP - Vector3(0.0, 0.0, -0.02)).norm(), 0.0, 1e-3);
}

TEST(Check, APartAThousandTimesSmallerThanItsHoleHasAWrongUnit) {
  std::vector<test::StructuresPtr> structures = smallStructures();
  structures[1] = test::boxStructures(Vector3::Constant(4e-5), 2e-5, 1e-5);
  const Finding scale = theOnlyProblem(findingsIn(smallScenario(), structures));
  EXPECT_EQ(scale.kind, FindingKind::kScale);
  EXPECT_EQ(scale.severity, Severity::kError);
  EXPECT_NEAR(1.0 / scale.value, 44.0 / 0.04, 30.0);
  EXPECT_THAT(scale.text, HasSubstr("times smaller than its hole in bay"));
}

TEST(Check, APartAThousandTimesLargerHasAWrongUnitAndItsFileIsNamed) {
  std::string text = with(smallScenario(), "{part: part}", "{box: [40, 40, 40]}");
  const ScenarioFile scenario = parsed(with(text, "[40, 40, 40]", "[20 m, 20 m, 20 m]"));
  std::vector<Eigen::AlignedBox3d> boxes(4);
  boxes[0] = Eigen::AlignedBox3d(Vector3::Constant(-0.04), Vector3::Constant(0.04));
  boxes[1] = Eigen::AlignedBox3d(Vector3::Constant(-20.0), Vector3::Constant(20.0));
  const std::vector<Finding> findings = findingsOf(Error{"too large"}, scenario, boxes);
  ASSERT_EQ(findings.size(), 2U);
  EXPECT_EQ(findings[0].kind, FindingKind::kScale);
  EXPECT_NEAR(findings[0].value, 500.0, 1e-9);
  EXPECT_THAT(findings[0].hint, HasSubstr("a length without its unit"));
  EXPECT_EQ(findings[1].text, "too large");
}

TEST(Check, AllObjectsOutOfReachAreFound) {
  std::string text = with(smallScenario(), "at: [0.2, 0, 0.1]", "at: [200, 0, 0.1]");
  text = with(text, "at: [0, 0, -20 mm]", "at: [0, 0, -20 m]");
  const ScenarioFile scenario = parsed(text);
  const auto scene = game_control::makeScene(scenario, smallStructures());
  ASSERT_FALSE(scene);
  const std::vector<Finding> findings = findingsOf(scene.error(), scenario, smallStructures());
  ASSERT_EQ(findings.size(), 2U);
  EXPECT_EQ(findings[0].kind, FindingKind::kReach);
  EXPECT_NEAR(findings[0].value, 200.0, 0.01);
  EXPECT_EQ(findings[1].line, 16);
  // a refusal for another reason is not hidden by them
  const std::vector<Finding> both = findingsOf(Error{"two pairs of one name"}, scenario, smallStructures());
  ASSERT_EQ(both.size(), 3U);
  EXPECT_EQ(both.back().text, "two pairs of one name");
}

}  // namespace
}  // namespace tenon::check
