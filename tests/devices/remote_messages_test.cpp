#include "devices/drivers/remote_messages.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "idl/types/random.h"

namespace tenon::devices {
namespace {

template <class T>
void put(std::vector<std::uint8_t>& bytes, T value) {
  const std::size_t at = bytes.size();
  bytes.resize(at + sizeof value);
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

std::vector<std::uint8_t> target(const Vector3& p, const Quaternion& q, double grip = 0.25,
                                 std::uint32_t magic = kRemoteMagic, std::uint16_t version = kRemoteVersion,
                                 std::uint16_t kind = 1) {
  std::vector<std::uint8_t> bytes;
  put(bytes, magic), put(bytes, version), put(bytes, kind);
  put(bytes, std::uint32_t{7}), put(bytes, std::uint32_t{5});
  for (const double v : {p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z(), grip}) put(bytes, v);
  return bytes;
}

const Vector3 kPlace(0.1, -0.2, 0.3);
const Quaternion kTurn(0.6, 0.0, 0.8, 0.0);

TEST(RemoteMessages, ATargetIsReadAsItsLayoutSays) {
  const auto read = decodeTarget(target(kPlace, kTurn));
  ASSERT_TRUE(read);
  EXPECT_EQ(read->seq, 7U);
  EXPECT_EQ(read->buttons, kRemoteMain | kRemoteHeld);
  EXPECT_EQ(read->X_DT.translation(), kPlace);
  EXPECT_TRUE(read->X_DT.rotation().isApprox(kTurn));
  EXPECT_EQ(read->grip, 0.25);
}

TEST(RemoteMessages, WhatIsNoTargetIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(decodeTarget({}));
  EXPECT_FALSE(decodeTarget(target(kPlace, kTurn, 0.0, kRemoteMagic + 1)));
  EXPECT_FALSE(decodeTarget(target(kPlace, kTurn, 0.0, kRemoteMagic, kRemoteVersion + 1)));
  EXPECT_FALSE(decodeTarget(target(kPlace, kTurn, 0.0, kRemoteMagic, kRemoteVersion, 2)));
  EXPECT_FALSE(decodeTarget(target(kPlace, kTurn, -0.1)));
  EXPECT_FALSE(decodeTarget(target(kPlace, kTurn, nan)));
  EXPECT_FALSE(decodeTarget(target(kPlace, Quaternion(0.0, 0.0, 0.0, 0.0))));
  EXPECT_FALSE(decodeTarget(target(kPlace, Quaternion(1.0, 0.5, 0.0, 0.0))));
  EXPECT_FALSE(decodeTarget(target(kPlace, Quaternion(nan, 0.0, 0.0, 0.0))));
  for (const double bad : {nan, inf, -inf, 10.1, 1e300}) {
    EXPECT_FALSE(decodeTarget(target(Vector3(bad, 0.0, 0.0), kTurn))) << bad;
  }
  std::vector<std::uint8_t> longer = target(kPlace, kTurn);
  longer.push_back(0);
  EXPECT_FALSE(decodeTarget(longer));
}

// each accepted message is one whose numbers are sound, whatever bytes arrive
TEST(RemoteMessages, AnyBytesAreRefusedOrSound) {
  Random random(20261123);
  const auto byte = [&random] { return static_cast<std::uint8_t>(random.uniform(0.0, 256.0)); };
  int accepted = 0;
  for (int round = 0; round < 200'000; ++round) {
    std::vector<std::uint8_t> bytes = target(kPlace, kTurn);
    const int changes = round % 4;
    for (int i = 0; i < changes; ++i)
      bytes[static_cast<std::size_t>(random.uniform(0.0, static_cast<double>(bytes.size())))] = byte();
    if (round % 16 == 0) bytes.resize(static_cast<std::size_t>(random.uniform(0.0, 200.0)), byte());
    const auto read = decodeTarget(bytes);
    if (!read) continue;
    ++accepted;
    ASSERT_EQ(bytes.size(), kRemoteTargetSize);
    ASSERT_TRUE(read->X_DT.isFinite());
    ASSERT_LE(read->X_DT.translation().norm(), kRemoteReach);
    ASSERT_NEAR(read->X_DT.rotation().norm(), 1.0, 1e-9);
    ASSERT_TRUE(read->grip >= 0.0 && read->grip <= 1.0);
  }
  EXPECT_GT(accepted, 50'000) << "the fuzz must reach what is behind the header";
}

TEST(RemoteMessages, AViewHasItsLayout) {
  RemoteView view;
  view.seq = 9;
  view.forces_on = true;
  view.shown.in_contact = true;
  view.cycle = 12;
  view.X_DH = Pose(Vector3(1.0, 2.0, 3.0));
  view.shown.X_DS = Pose(Vector3(4.0, 5.0, 6.0), kTurn);
  view.shown.X_DO = Pose(Vector3(7.0, 8.0, 9.0));
  view.shown.p_WC = Vector3(0.1, 0.2, 0.3);
  view.F_Ho_D.force = Vector3(0.4, 0.5, 0.6);
  view.shown.object = ObjectId{3};
  const auto bytes = encodeView(view);
  const auto number = [&](std::size_t at) {
    double value = 0.0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
  };
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
  };
  EXPECT_EQ(word(0), kRemoteMagic);
  EXPECT_EQ(word(4), kRemoteVersion | 2U << 16U);
  EXPECT_EQ(word(8), 9U);
  EXPECT_EQ(word(12), 1U | 4U);
  EXPECT_EQ(word(16), 12U);
  EXPECT_EQ(number(24), 1.0);
  EXPECT_EQ(number(80), 4.0);
  EXPECT_EQ(number(104), 0.6);
  EXPECT_EQ(number(136), 7.0);
  EXPECT_EQ(number(192), 0.1);
  EXPECT_EQ(number(216), 0.4);
  EXPECT_EQ(word(264), 3U);
}

}  // namespace
}  // namespace tenon::devices
