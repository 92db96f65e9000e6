#include "clients/station/hand_trajectory.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tenon::station {
namespace {

using ::testing::HasSubstr;

const std::string kHeader = "t,x,y,z,qw,qx,qy,qz\n";

HandTrajectory handTrajectory(const std::string& rows) {
  return HandTrajectory::parse(kHeader + rows, "hand.csv").value();
}

std::string refusal(const std::string& text) {
  const auto parsed = HandTrajectory::parse(text, "hand.csv");
  return parsed ? "accepted" : parsed.error().what;
}

TEST(HandTrajectory, PositionsAreLinearAndOrientationsTurnAtConstantVelocityBetweenRows) {
  // a quarter turn about z from x = 0 to x = 0.4
  const double half = std::sqrt(0.5);
  const HandTrajectory moved = handTrajectory("0,0,1,2,1,0,0,0\n2,0.4,1,2," + std::to_string(half) + ",0,0," +
                                              std::to_string(half) + "\n");
  for (const double fraction : {0.1, 0.25, 0.5, 0.9}) {
    const Pose X_WH = moved.poseAt(2.0 * fraction);
    EXPECT_NEAR((X_WH.translation() - Vector3(0.4 * fraction, 1.0, 2.0)).norm(), 0.0, 1e-15);
    const double angle = fraction * std::numbers::pi / 2.0;
    EXPECT_NEAR(X_WH.rotation().w(), std::cos(angle / 2.0), 1e-12);
    EXPECT_NEAR(X_WH.rotation().z(), std::sin(angle / 2.0), 1e-12);
    EXPECT_NEAR(X_WH.rotation().norm(), 1.0, 1e-15);
  }
}

TEST(HandTrajectory, TheSmallerAngleIsTakenWhateverTheSignsOfTheQuaternions) {
  const Pose X_WH = handTrajectory("0,0,0,0,1,0,0,0\n1,0,0,0,-0.96,0,0,-0.28\n").poseAt(0.5);
  const Vector3 w = logRotation(X_WH.rotation());
  EXPECT_NEAR(w.z(), std::atan2(0.28, 0.96), 1e-12) << "half of 2 atan2(0.28, 0.96), not of 2 pi less that";
}

TEST(HandTrajectory, ARowsTimeHasThatRowExactlyAndTheEndsAreHeld) {
  const HandTrajectory moved =
      handTrajectory("0.5,1,0,0,0.6,0.8,0,0\n0.75,2,0,0,1,0,0,0\n1,3,0,0,0.8,0,0.6,0\n");
  const Quaternion first = Quaternion(0.6, 0.8, 0.0, 0.0).normalized();
  for (const double t : {-1.0, 0.0, 0.5}) EXPECT_EQ(moved.poseAt(t), Pose(Vector3(1, 0, 0), first)) << t;
  EXPECT_EQ(moved.poseAt(0.75), Pose(Vector3(2, 0, 0)));
  const Quaternion last = Quaternion(0.8, 0.0, 0.6, 0.0).normalized();
  for (const double t : {1.0, 1.5, 1e300}) EXPECT_EQ(moved.poseAt(t), Pose(Vector3(3, 0, 0), last)) << t;
  EXPECT_EQ(moved.end(), 1.0);
  EXPECT_EQ(moved.lineAt(0.0), 2U);
  EXPECT_EQ(moved.lineAt(0.8), 3U);
  EXPECT_EQ(moved.lineAt(9.0), 4U);
}

TEST(HandTrajectory, AQuaternionNearUnitLengthIsNormalised) {
  const Quaternion q_WH = handTrajectory("0,0,0,0,1.009,0,0,0\n").poseAt(0.0).rotation();
  EXPECT_EQ(q_WH.coeffs(), Quaternion::Identity().coeffs());
}

TEST(HandTrajectory, WhatSpreadsheetsWriteIsRead) {
  const auto parsed = HandTrajectory::parse(
      "\xEF\xBB\xBF t, x, y, z, qw, qx, qy, qz \r\n\r\n0, +1.5, -2e-1 ,.5,1,0,0,0\r\n\n1,0,0,0,1,0,0,0",
      "hand.csv");
  ASSERT_TRUE(parsed) << parsed.error().what;
  EXPECT_EQ(parsed->poseAt(0.0).translation(), Vector3(1.5, -0.2, 0.5));
  EXPECT_EQ(parsed->lineAt(1.0), 5U) << "blank lines count";
}

TEST(HandTrajectory, AnErrorNamesTheLineAndWhatWasExpected) {
  const std::string row = "0,0,0,0,1,0,0,0\n";
  const std::vector<std::pair<std::string, std::string>> texts{
      {"", "hand.csv:1: empty, expected the header t,x,y,z,qw,qx,qy,qz and a row"},
      {"\n \n", "hand.csv:2: empty, expected the header t,x,y,z,qw,qx,qy,qz and a row"},
      {row, "hand.csv:1: expected the header t,x,y,z,qw,qx,qy,qz, found '0,0,0,0,1,0,0,0'"},
      {"t,x,y,z,qx,qy,qz,qw\n" + row,
       "hand.csv:1: expected the header t,x,y,z,qw,qx,qy,qz, found 't,x,y,z,qx,qy,qz,qw'"},
      {kHeader, "hand.csv:1: no row after the header, expected at least one"},
      {kHeader + row + "1,0,0,0,1,0,0\n", "hand.csv:3: 7 fields, expected 8: t,x,y,z,qw,qx,qy,qz"},
      {kHeader + row + "1,0,0,0,1,0,0,0,\n", "hand.csv:3: 9 fields, expected 8: t,x,y,z,qw,qx,qy,qz"},
      {kHeader + "0,0,abc,0,1,0,0,0\n", "hand.csv:2: y is 'abc', not a number"},
      {kHeader + "0,0,,0,1,0,0,0\n", "hand.csv:2: y is '', not a number"},
      {kHeader + "0,0,0,1 2,1,0,0,0\n", "hand.csv:2: z is '1 2', not a number"},
      {kHeader + "0,0x1,0,0,1,0,0,0\n", "hand.csv:2: x is '0x1', not a number"},
      {kHeader + "0,+-1,0,0,1,0,0,0\n", "hand.csv:2: x is '+-1', not a number"},
      {kHeader + "0,1\x01\xff,0,0,1,0,0,0\n", "hand.csv:2: x is '1?\?', not a number"},
      {kHeader + "nan,0,0,0,1,0,0,0\n",
       "hand.csv:2: t is 'nan', not a finite number in the range of a double"},
      {kHeader + "0,0,0,0,1,0,0,-inf\n",
       "hand.csv:2: qz is '-inf', not a finite number in the range of a double"},
      {kHeader + "0,1e999,0,0,1,0,0,0\n",
       "hand.csv:2: x is '1e999', not a finite number in the range of a double"},
      {kHeader + row + "0,0,0,0,1,0,0,0\n", "hand.csv:3: t is 0, not after the 0 of line 2"},
      {kHeader + row + "\n-0.5,0,0,0,1,0,0,0\n", "hand.csv:4: t is -0.5, not after the 0 of line 2"},
      {kHeader + "0,0,0,0,1,0.2,0,0\n",
       "hand.csv:2: the quaternion's length is 1.02, expected 1 within 0.01"},
      {kHeader + "0,0,0,0,0,0,0,0\n", "hand.csv:2: the quaternion's length is 0, expected 1 within 0.01"},
      {kHeader + "0,0,0,0,1e200,0,0,0\n", "hand.csv:2: the quaternion's length is "}};
  for (const auto& [text, expected] : texts) EXPECT_THAT(refusal(text), HasSubstr(expected)) << text;
}

TEST(HandTrajectory, AFileThatCannotBeReadIsNamed) {
  EXPECT_EQ(HandTrajectory::read("/nowhere/hand.csv").error().what, "/nowhere/hand.csv: cannot be read");
  EXPECT_EQ(HandTrajectory::read("/").error().what, "/: is a folder, expected a CSV file");
}

/// One to four random edits: a byte replaced or inserted, a piece erased or repeated elsewhere.
std::string damaged(std::string text, std::mt19937_64& random) {
  constexpr char kTroublesome[] = ",\n\r \t+-.eE0123456789naif\"\0\x80\xff";
  for (std::uint64_t edit = 1 + random() % 4; edit > 0; --edit) {
    const std::size_t at = random() % text.size();
    const std::size_t length = 1 + random() % 30;
    const char byte = kTroublesome[random() % (sizeof(kTroublesome) - 1)];
    switch (random() % 4) {
      case 0:
        text[at] = byte;
        break;
      case 1:
        text.insert(at, 1, byte);
        break;
      case 2:
        text.erase(at, length);
        break;
      default:
        text.insert(random() % text.size(), text.substr(at, length));
        break;
    }
    if (text.empty()) text = "x";
  }
  return text;
}

/// A text is read to a handTrajectory whose poses are finite, or refused with a line that it has.
void expectReadOrRefused(const std::string& text, int& refused) {
  const auto parsed = HandTrajectory::parse(text, "hand.csv");
  if (parsed) {
    for (const double t : {-1.0, 0.0, 0.015, 0.4, 1e9}) {
      const Pose X_WH = parsed->poseAt(t);
      ASSERT_NEAR(X_WH.rotation().norm(), 1.0, 1e-9) << text;
    }
    return;
  }
  ++refused;
  const std::string& what = parsed.error().what;
  ASSERT_EQ(what.rfind("hand.csv:", 0), 0U) << what;
  const auto line = std::stoul(what.substr(9));
  ASSERT_GE(line, 1U) << what;
  ASSERT_LE(line, 1U + static_cast<unsigned long>(std::count(text.begin(), text.end(), '\n'))) << what;
}

TEST(HandTrajectoryFuzz, DamagedFilesAreReadOrRefusedWithTheirLine) {
  std::string text = kHeader;
  for (int i = 0; i < 20; ++i)
    text += std::to_string(0.02 * i) + "," + std::to_string(1e-3 * i) + ",-0.25,1e-2,0.8,0,0.6,0\n";
  std::mt19937_64 random(1);
  int refused = 0;
  for (int i = 0; i < 5000; ++i) expectReadOrRefused(damaged(text, random), refused);
  EXPECT_GT(refused, 1000) << "most damage is noticed";
  EXPECT_LT(refused, 5000) << "and some is none";
}

TEST(HandTrajectoryFuzz, RandomBytesAreRefusedWithTheirLine) {
  std::mt19937_64 random(2);
  int refused = 0;
  for (int i = 0; i < 5000; ++i) {
    std::string text = i % 2 == 0 ? "" : kHeader;
    for (std::uint64_t length = random() % 200; length > 0; --length) text += static_cast<char>(random());
    expectReadOrRefused(text, refused);
  }
  EXPECT_GT(refused, 4990) << "bytes are no rows but by a rare chance";
}

}  // namespace
}  // namespace tenon::station
