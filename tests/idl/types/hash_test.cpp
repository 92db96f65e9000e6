#include "idl/types/hash.h"

#include <set>

#include <gtest/gtest.h>

namespace tenon {
namespace {

std::uint64_t hashOf(const Pose& X) {
  StateHash hash;
  hash.add(X);
  return hash.value();
}

TEST(StateHash, IsEqualForEqualStates) {
  const Pose X(Vector3(1, 2, 3), Quaternion(0.5, 0.5, 0.5, 0.5));
  EXPECT_EQ(hashOf(X), hashOf(X));
}

TEST(StateHash, DependsOnTheLastBitOfEachNumber) {
  const Pose X(Vector3(1, 2, 3), Quaternion(0.5, 0.5, 0.5, 0.5));
  std::set<std::uint64_t> hashes{hashOf(X)};
  for (int i = 0; i < 3; ++i) {
    Pose moved = X;
    moved.translation()[i] = std::nextafter(moved.translation()[i], 10.0);
    hashes.insert(hashOf(moved));
  }
  for (int i = 0; i < 4; ++i) {
    Pose turned = X;
    turned.rotation().coeffs()[i] = std::nextafter(turned.rotation().coeffs()[i], 10.0);
    hashes.insert(hashOf(turned));
  }
  EXPECT_EQ(hashes.size(), 8U);
}

TEST(StateHash, DependsOnTheOrder) {
  StateHash forth;
  forth.add(std::uint64_t{1});
  forth.add(std::uint64_t{2});
  StateHash back;
  back.add(std::uint64_t{2});
  back.add(std::uint64_t{1});
  EXPECT_NE(forth.value(), back.value());
}

}  // namespace
}  // namespace tenon
