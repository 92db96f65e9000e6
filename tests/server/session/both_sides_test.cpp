#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "server/bake/shapes.h"
#include "server/simulation/environment.h"
#include "tests/server/session/two_parts.h"
#include "tests/support/known_shortfall.h"
#include "tests/support/test_meshes.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;
using simulation::Environment;

constexpr double kPush = 0.01;  // [m] of the hand beyond the contact: 10 N

class BothSides : public test::TwoParts {
 protected:
  /// Pose of the held part after the hand went straight down from `above` [m] over X_WO to kPush below, and
  /// stayed there.
  static Pose pressedDown(const std::shared_ptr<const simulation::Scene>& scene, const Pose& X_WO,
                          double above = 0.003) {
    constexpr int kTicks = 200;
    constexpr int kSettle = 50;
    Environment environment(scene, {});
    const HandId hand{0};
    environment.setHandPresent(hand, true);
    for (int tick = 0; tick <= kTicks + kSettle; ++tick) {
      const double way = std::min(1.0, static_cast<double>(tick) / kTicks) * (above + kPush);
      environment.setHandPose(hand,
                              Pose(X_WO.translation() + Vector3(0.0, 0.0, above - way), X_WO.rotation()), {});
      environment.step();
    }
    return environment.objects()[1].X_WO;
  }
};

constexpr int kOffsets = 8;           // along x, and along y
constexpr double kOffsetStep = 5e-4;  // [m]

//  [======]   a plate in a hand
//     ||      a stud
//  ========
class Studs : public BothSides, public ::testing::WithParamInterface<double> {};

TEST_P(Studs, DoNotEnterAFlatFaceBetweenItsPoints) {
  constexpr double kTip = 0.015;        // [m]
  constexpr double kHalfPlate = 0.005;  // [m]
  const double radius = 0.5 * GetParam();
  const auto scene = load(fmt::format("{{box: [120 mm, 120 mm, 20 mm], at: [0, 0, -10 mm]}}, "
                                      "{{cylinder: {{radius: {}, length: 20 mm}}, at: [0, 0, 5 mm]}}",
                                      radius),
                          "{box: [40 mm, 40 mm, 10 mm]}", 2.0);
  ASSERT_TRUE(scene);
  ASSERT_EQ(scene->pairs.size(), 1U) << "the product makes one pair";
  // [m] how far the rim of the stud's tip is behind the face
  const auto entered = [&](const Pose& X_WO) {
    double deepest = -1.0;
    for (const double x : {-radius, 0.0, radius}) {
      for (const double y : {-radius, 0.0, radius}) {
        deepest = std::max(deepest, (X_WO.inverse() * Vector3(x, y, kTip)).z() + kHalfPlate);
      }
    }
    return deepest;
  };
  double deepest = -1.0;
  double without = -1.0;
  for (int i = 0; i < kOffsets; ++i) {
    for (int j = 0; j < kOffsets; ++j) {
      const Pose X_WO(Vector3(kOffsetStep * i, kOffsetStep * j, kTip + kHalfPlate));
      deepest = std::max(deepest, entered(pressedDown(scene, X_WO)));
      if (i % 4 == 1 && j % 4 == 1)
        without = std::max(without, entered(pressedDown(withoutFeatures(*scene), X_WO)));
    }
  }
  EXPECT_LE(deepest, 0.0003);
  // points of the plate may meet the stud's dilation before its features meet the face
  const double dilation = scene->objects[0].structures->field.dilation();
  EXPECT_GE(deepest, -0.0003 - dilation) << "it does not reach the face";
  const bool is_held_off = without < 0.0;
  EXPECT_TRUE(is_held_off || without > deepest + 1e-4) << "one direction alone is as good: nothing is tested";
  RecordProperty("deepest_um", static_cast<int>(std::lround(1e6 * deepest)));
  RecordProperty("one_direction_um", static_cast<int>(std::lround(1e6 * without)));
}

INSTANTIATE_TEST_SUITE_P(Diameters, Studs, ::testing::Values(0.001, 0.002, 0.003, 0.004, 0.006),
                         [](const auto& one) { return fmt::format("{}mm", std::lround(1e3 * one.param)); });

struct DomeCase {
  const char* name;
  double diameter_mm;
  int level;           ///< of its facets: 5 turn by 2 degrees, 2 by 18
  double known = 0.0;  ///< [m] that it enters today; 0: no more than promised
};
void PrintTo(const DomeCase& one, std::ostream* out) { *out << one.name; }

//  [======]   a plate in a hand
//     ()      a stud with the end of a ball
//  ========
class Domes : public BothSides, public ::testing::WithParamInterface<DomeCase> {};

TEST_P(Domes, DoNotEnterAFlatFaceBetweenItsPoints) {
  constexpr double kTip = 0.015;        // [m]
  constexpr double kHalfPlate = 0.005;  // [m]
  const double radius = 0.5e-3 * GetParam().diameter_mm;
  fs::create_directories(folder_);
  ASSERT_TRUE(bake::writeStl(folder_ / "ball.stl",
                             test::ballMesh(radius, GetParam().level, {0.0, 0.0, kTip - radius}), 1e-3));
  const auto scene = load(fmt::format("{{box: [120 mm, 120 mm, 20 mm], at: [0, 0, -10 mm]}}, "
                                      "{{cylinder: {{radius: {}, length: 20 mm}}, at: [0, 0, {}]}}, "
                                      "{{file: ball.stl, unit: mm}}",
                                      radius, kTip - radius - 0.01),
                          "{box: [40 mm, 40 mm, 10 mm]}", 2.0);
  ASSERT_TRUE(scene);
  double lowest = 1.0;
  double highest = -1.0;
  for (int i = 0; i < kOffsets; ++i) {
    for (int j = 0; j < kOffsets; ++j) {
      const Pose X_WO(Vector3(kOffsetStep * i, kOffsetStep * j, kTip + kHalfPlate));
      const Pose X_WO_pressed = pressedDown(scene, X_WO);
      const double height =
          (X_WO_pressed * Vector3(-kOffsetStep * i, -kOffsetStep * j, -kHalfPlate)).z() - kTip;
      lowest = std::min(lowest, height);
      highest = std::max(highest, height);
    }
  }
  if (GetParam().known > 0.0) {
    EXPECT_TRUE(test::knownShortfall(-lowest, 0.0003, GetParam().known));
  } else {
    EXPECT_GE(lowest, -0.0003);
  }
  EXPECT_LE(highest, 0.0003 + scene->objects[0].structures->field.dilation()) << "it does not reach the dome";
}

INSTANTIATE_TEST_SUITE_P(Diameters, Domes,
                         ::testing::Values(DomeCase{"Fine1mm", 1.0, 5}, DomeCase{"Fine2mm", 2.0, 5},
                                           DomeCase{"Fine4mm", 4.0, 5}, DomeCase{"Fine6mm", 6.0, 5, 0.0004},
                                           DomeCase{"Coarse2mm", 2.0, 2}, DomeCase{"Coarse4mm", 4.0, 2}),
                         [](const auto& one) { return std::string(one.param.name); });

struct CrossingCase {
  const char* name;
  double voxel_mm;
  double turn;  ///< [rad] of the held bar about the vertical
  double roll;  ///< [rad] about its length, from edge down
};
void PrintTo(const CrossingCase& one, std::ostream* out) { *out << one.name; }

//   <>     a bar in a hand, one edge down
//  =====   a bar with one edge up, across
class Crossings : public BothSides, public ::testing::WithParamInterface<CrossingCase> {};

TEST_P(Crossings, OfEdgesDoNotOverlap) {
  const CrossingCase& one = GetParam();
  constexpr double kEdge = 0.0070710678;  // [m] of a bar from its axis: half the diagonal of 10 mm
  const auto scene = load("{box: [10 mm, 120 mm, 10 mm], turn: {axis: y, deg: 45}}",
                          "{box: [60 mm, 10 mm, 10 mm], turn: {axis: x, deg: 45}}", one.voxel_mm);
  ASSERT_TRUE(scene);
  const Quaternion q = expRotation({0.0, 0.0, one.turn}) * expRotation({one.roll, 0.0, 0.0});
  const auto overlap = [&](const Pose& X_WO) {
    const Vector3 p_WA = X_WO * Vector3(0.0, 0.0, -kEdge);
    const Vector3 along_A = X_WO.rotation() * Vector3::UnitX();
    const Vector3 n_W = along_A.cross(Vector3::UnitY()).normalized();
    return std::abs(n_W.z()) < 0.5
               ? -1.0
               : -(p_WA - Vector3(0.0, 0.0, kEdge)).dot(n_W * (n_W.z() > 0.0 ? 1.0 : -1.0));
  };
  double deepest = -1.0;
  double without = -1.0;
  for (int i = 0; i < kOffsets; ++i) {
    for (int j = 0; j < kOffsets; ++j) {
      const Pose X_WO(Vector3(kOffsetStep * i, kOffsetStep * j, 2.0 * kEdge), q);
      deepest = std::max(deepest, overlap(pressedDown(scene, X_WO)));
      if (i % 4 == 1 && j % 4 == 1)
        without = std::max(without, overlap(pressedDown(withoutFeatures(*scene), X_WO)));
    }
  }
  EXPECT_LE(deepest, 0.0002);
  EXPECT_GE(deepest, -0.0002) << "they do not reach each other";
  EXPECT_GT(without, deepest + 1e-4) << "one direction alone is as good: nothing is tested here";
  RecordProperty("deepest_um", static_cast<int>(std::lround(1e6 * deepest)));
  RecordProperty("one_direction_um", static_cast<int>(std::lround(1e6 * without)));
}

INSTANTIATE_TEST_SUITE_P(Bars, Crossings,
                         ::testing::Values(CrossingCase{"Voxel1", 1.0, 0.0, 0.0},
                                           CrossingCase{"Voxel2", 2.0, 0.0, 0.0},
                                           CrossingCase{"Turned", 2.0, 0.6, 0.0},
                                           CrossingCase{"Rolled", 2.0, 0.3, 0.3}),
                         [](const auto& one) { return std::string(one.param.name); });

struct RimCase {
  const char* name;
  int cells;         ///< of the sheet along each side, two triangles each
  const char* held;  ///< its lowest point is 10 mm below its origin
};
void PrintTo(const RimCase& one, std::ostream* out) { *out << one.name; }

//  <=====>   a bar or a pin in a hand
//     |      a sheet without thickness, on edge, in refined bricks
class Rims : public BothSides, public ::testing::WithParamInterface<RimCase> {
 protected:
  std::string sheet() const {
    constexpr float kSide = 0.06F;  // [m] from the origin down, and to either side of it
    const int cells = GetParam().cells;
    bake::TriangleMesh mesh;
    const auto at = [&](int i) { return kSide * static_cast<float>(i) / static_cast<float>(cells); };
    const auto corner = [&](int i, int j) { return static_cast<std::uint32_t>(i * (cells + 1) + j); };
    for (int i = 0; i <= cells; ++i)
      for (int j = 0; j <= cells; ++j) mesh.vertices.emplace_back(0.0F, at(i) - 0.5F * kSide, -at(j));
    for (int i = 0; i < cells; ++i) {
      for (int j = 0; j < cells; ++j) {
        mesh.triangles.push_back({corner(i, j), corner(i + 1, j), corner(i + 1, j + 1)});
        mesh.triangles.push_back({corner(i, j), corner(i + 1, j + 1), corner(i, j + 1)});
      }
    }
    fs::create_directories(folder_);
    EXPECT_TRUE(bake::writeStl(folder_ / "sheet.stl", mesh, 1e-3));
    return "{file: sheet.stl, unit: mm}";
  }
};

TEST_P(Rims, OfASheetHoldWhatIsPressedOnThem) {
  const auto scene =
      load(sheet(), GetParam().held, 3.0,
           "refinement: 8, refine: [{from: [-0.01, -0.035, -0.065], to: [0.01, 0.035, 0.005]}]");
  ASSERT_TRUE(scene);
  double lowest = 1.0;
  double highest = -1.0;
  for (int i = 0; i < kOffsets; ++i) {
    for (int j = 0; j < kOffsets; ++j) {
      const Pose X_WO(Vector3(kOffsetStep * i, kOffsetStep * j - 0.002, 0.01));
      const double height = pressedDown(scene, X_WO).translation().z() - 0.01;
      lowest = std::min(lowest, height);
      highest = std::max(highest, height);
    }
  }
  EXPECT_GE(lowest, -0.0003);
  EXPECT_LE(highest, 0.0005) << "it does not reach the rim";
}

constexpr const char* kBar = "{box: [60 mm, 14.142 mm, 14.142 mm], turn: {axis: x, deg: 45}}";
constexpr const char* kPin = "{cylinder: {radius: 5 mm, length: 20 mm}}";
INSTANTIATE_TEST_SUITE_P(Sheets, Rims,
                         ::testing::Values(RimCase{"BarOnTwoTriangles", 1, kBar},
                                           RimCase{"BarOnEighteen", 3, kBar}, RimCase{"BarOnMany", 12, kBar},
                                           RimCase{"PinOnTwoTriangles", 1, kPin},
                                           RimCase{"PinOnMany", 12, kPin}),
                         [](const auto& one) { return std::string(one.param.name); });

struct TaperCase {
  const char* name;
  bool refined;        ///< voxels of 0.075 mm in the socket, else of 0.6 mm
  Vector3 turn;        ///< [rad] rotation vector of both meshes in their grids
  int corners = 4;     ///< of a cross-section: 4, a rectangle, or 3, an equilateral triangle
  double known = 0.0;  ///< [m] that it stands proud today; 0: no more than promised
};
void PrintTo(const TaperCase& one, std::ostream* out) { *out << one.name; }

//  \\    //   a tapered tenon in a hand
//  #\\__//#   a socket with the same walls
class Tapers : public BothSides, public ::testing::WithParamInterface<TaperCase> {
 protected:
  static constexpr double kSlope = 0.0436609;  // [-] tan 2.5 degrees
  static constexpr double kPromised = 5e-4;    // [m]

  using Outline = std::vector<Vector3>;

  /// The taper's cross-section at height z [m], with all its walls `wider` [m] outwards.
  static Outline outline(double z, double wider) {
    const double x = 0.012 + kSlope * z + wider;
    const double y = 0.008 + kSlope * z + wider;
    if (GetParam().corners == 4)
      return {Vector3(x, y, z), Vector3(-x, y, z), Vector3(-x, -y, z), Vector3(x, -y, z)};
    const double w = std::sqrt(3.0) * y;  // y is the inscribed circle's radius
    return {Vector3(w, -y, z), Vector3(0.0, 2.0 * y, z), Vector3(-w, -y, z)};
  }

  /// Quadrilaterals between two outlines, outwards for lower, upper; inwards for upper, lower.
  static void addWalls(bake::TriangleMesh& mesh, const Outline& lower, const Outline& upper) {
    for (std::size_t i = 0; i < lower.size(); ++i) {
      const std::size_t next = (i + 1) % lower.size();
      addPolygon(mesh, {lower[i], lower[next], upper[next], upper[i]});
    }
  }
  static void addPolygon(bake::TriangleMesh& mesh, const Outline& corners) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (const Vector3& corner : corners) mesh.vertices.push_back(corner.cast<float>());
    for (std::uint32_t i = 2; i < corners.size(); ++i)
      mesh.triangles.push_back({first, first + i - 1, first + i});
  }
  static Outline reversed(const Outline& corners) { return {corners.rbegin(), corners.rend()}; }

  std::string write(const char* name, bake::TriangleMesh mesh) const {
    const Quaternion q = expRotation(GetParam().turn);
    for (Vector3f& p : mesh.vertices) p = (q * p.cast<double>()).cast<float>();
    fs::create_directories(folder_);
    EXPECT_TRUE(bake::writeStl(folder_ / name, mesh, 1e-3));
    return fmt::format("{{file: {}, unit: mm}}", name);
  }

  /// Keys of the socket's structures: with a box around the walls that the tenon fits.
  static std::string refine() {
    if (!GetParam().refined) return "refinement: 1";
    const Quaternion q = expRotation(GetParam().turn);
    Eigen::AlignedBox3d box;
    for (const double z : {-0.0205, 0.0005})
      for (const Vector3& corner : outline(z, 5e-4)) box.extend(q * corner);
    return fmt::format("refinement: 8, refine: [{{from: [{}, {}, {}], to: [{}, {}, {}]}}]", box.min().x(),
                       box.min().y(), box.min().z(), box.max().x(), box.max().y(), box.max().z());
  }

  std::string tenon() const {
    const auto lower = outline(-0.016, 0.0);
    const auto upper = outline(0.02, 0.0);
    bake::TriangleMesh mesh;
    addWalls(mesh, lower, upper);
    addPolygon(mesh, reversed(lower));
    addPolygon(mesh, upper);
    return write("tenon.stl", mesh);
  }

  std::string socket() const {
    constexpr double kFloor = -0.02, kBottom = -0.03, kWall = 0.01;
    auto block_top = outline(0.0, kWall);
    auto block_bottom = block_top;
    for (Vector3& p : block_bottom) p.z() = kBottom;
    bake::TriangleMesh mesh;
    addWalls(mesh, block_bottom, block_top);
    addPolygon(mesh, reversed(block_bottom));
    addWalls(mesh, block_top, outline(0.0, 0.0));
    addWalls(mesh, outline(0.0, 0.0), outline(kFloor, 0.0));
    addPolygon(mesh, outline(kFloor, 0.0));
    return write("socket.stl", mesh);
  }
};

TEST_P(Tapers, SeatNearTheirExactSeat) {
  const Quaternion q = expRotation(GetParam().turn);
  const auto scene = load(socket(), tenon(), 0.6, refine());
  ASSERT_TRUE(scene);
  // the socket's axis is upright
  auto upright = std::make_shared<simulation::Scene>(*scene);
  upright->objects[0].X_WO = Pose(Vector3::Zero(), q.conjugate());
  double highest = -1.0;
  double lowest = 1.0;
  for (const double turn : {-0.02, 0.0, 0.03}) {
    const Pose X_WS = pressedDown(
        upright, Pose(Vector3(2e-4, -1e-4, 0.0), expRotation({0.0, turn, 0.0}) * q.conjugate()), 0.006);
    const Vector3 seat = X_WS * Vector3(q * Vector3(0.0, 0.0, -0.008));
    highest = std::max(highest, seat.z() + 0.008);
    lowest = std::min(lowest, seat.z() + 0.008);
  }
  EXPECT_LE(highest, std::max(kPromised, GetParam().known)) << "it stands proud";
  EXPECT_GE(lowest, -kPromised) << "it is driven in";
  RecordProperty("highest_um", static_cast<int>(std::lround(1e6 * highest)));
  RecordProperty("lowest_um", static_cast<int>(std::lround(1e6 * lowest)));
}

std::vector<TaperCase> taperCases() {
  // turns about any axis, by up to 1.8 rad
  static constexpr std::array<std::array<double, 3>, 14> kTurns{{{0.0, 0.0, 0.0},
                                                                 {0.08, 0.16, 0.24},
                                                                 {-0.80, 0.66, -0.29},
                                                                 {0.15, -0.32, -0.16},
                                                                 {1.15, 0.50, 0.09},
                                                                 {0.28, -0.17, -0.30},
                                                                 {1.19, -0.33, -0.75},
                                                                 {-0.17, -0.12, -0.47},
                                                                 {0.94, 1.20, -0.54},
                                                                 {0.40, 0.24, 0.33},
                                                                 {-1.66, -0.06, -0.69},
                                                                 {-0.48, -0.40, 0.10},
                                                                 {-0.37, 1.22, 1.52},
                                                                 {0.50, -0.31, -0.36}}};
  static const char* const kNames[] = {"Upright", "Turn1", "Turn2", "Turn3",  "Turn4",  "Turn5",  "Turn6",
                                       "Turn7",   "Turn8", "Turn9", "Turn10", "Turn11", "Turn12", "Turn13"};
  std::vector<TaperCase> cases;
  for (std::size_t i = 0; i < kTurns.size(); ++i)
    cases.push_back({kNames[i], true, Vector3(kTurns[i][0], kTurns[i][1], kTurns[i][2])});
  // edges of 60 degrees, which are thin in voxels; they stand 1.4 to 1.8 mm proud
  cases.push_back({"Triangle", true, Vector3::Zero(), 3, 0.002});
  cases.push_back({"TriangleTurn2", true, Vector3(-0.80, 0.66, -0.29), 3, 0.002});
  cases.push_back({"TriangleTurn6", true, Vector3(1.19, -0.33, -0.75), 3, 0.002});
  return cases;
}
INSTANTIATE_TEST_SUITE_P(Fits, Tapers, ::testing::ValuesIn(taperCases()),
                         [](const auto& one) { return std::string(one.param.name); });

}  // namespace
}  // namespace tenon::session
