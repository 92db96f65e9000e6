#include "server/bake/point_block.h"

#include <algorithm>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace tenon::bake {
namespace {

constexpr double kFar = 1e3;  // [m]

class PointsAndTriangles {
 public:
  /// Some are slivers, without area, or on a grid, so that points are exactly at borders of regions.
  structures::Triangle triangle(int number) {
    structures::Triangle t{vector(number), vector(number), vector(number)};
    if (number % 7 == 0) t[1] = t[0];
    if (number % 11 == 0) t[2] = (t[0] + t[1]) / 2;
    if (number % 13 == 0) t[2] = t[1] + 1e-9 * t[2];
    return t;
  }
  Vector3 vector(int number) {
    if (number % 3 == 0) return {grid_(random_) * 0.25, grid_(random_) * 0.25, grid_(random_) * 0.25};
    return {real_(random_), real_(random_), real_(random_)};
  }

 private:
  std::mt19937 random_{1};
  std::uniform_real_distribution<double> real_{-1.0, 1.0};
  std::uniform_int_distribution<int> grid_{-4, 4};
};

TEST(PointBlock, HasTheBitsOfSinglePoints) {
  PointsAndTriangles random;
  for (int number = 0; number < 2000; ++number) {
    PointBlock block;
    std::vector<double> squared;
    for (int k = 0; k < 1 + number % 64; ++k) {
      block.add(random.vector(number), kFar);
      squared.push_back(kFar);
    }
    block.finish();
    for (int k = 0; k < 4; ++k) {
      const structures::Triangle t = random.triangle(number + k);
      block.lower(t, 1e-9);
      double largest = 0.0;
      for (std::size_t i = 0; i < squared.size(); ++i) {
        squared[i] = std::min(squared[i], structures::squaredDistance(block.point(i), t));
        ASSERT_EQ(block.squared(i), squared[i]) << "point " << i << " of " << number << ", triangle " << k;
        largest = std::max(largest, squared[i]);
      }
      ASSERT_EQ(block.largest(), largest);
    }
  }
}

}  // namespace
}  // namespace tenon::bake
