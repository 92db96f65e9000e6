#include "server/bake/shapes.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <numbers>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/bake/bake.h"

namespace tenon::bake {
namespace {

using std::numbers::pi;

constexpr double kRounding = 1e-6;  // [-] of single precision, with room for sums

struct Measured {
  double area = 0.0;    // [m^2]
  double volume = 0.0;  // [m^3] positive when the normals point outward
};

Measured measure(const TriangleMesh& mesh) {
  Measured sum;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vector3 p = mesh.vertices[a].cast<double>();
    const Vector3 q = mesh.vertices[b].cast<double>();
    const Vector3 r = mesh.vertices[c].cast<double>();
    sum.area += (q - p).cross(r - p).norm() / 2;
    sum.volume += p.dot(q.cross(r)) / 6;
  }
  return sum;
}

/// Each directed edge occurs once, and once the other way: closed, and of one orientation.
bool isClosed(const TriangleMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) ++edges[{t[i], t[(i + 1) % 3]}];
  return std::all_of(edges.begin(), edges.end(), [&](const auto& edge) {
    const auto back = edges.find({edge.first.second, edge.first.first});
    return edge.second == 1 && back != edges.end() && back->second == 1;
  });
}

Vector3 sizeOf(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Vector3f& p : mesh.vertices) box.extend(p.cast<double>());
  return box.sizes();
}

using SignedDistance = std::function<double(const Vector3&)>;  // [m] to the ideal solid, negative inside

SignedDistance boxDistance(const Vector3& edges) {
  return [edges](const Vector3& p) {
    const Vector3 q = p.cwiseAbs() - edges / 2;
    return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
  };
}
SignedDistance sphereDistance(double radius) {
  return [radius](const Vector3& p) { return p.norm() - radius; };
}
SignedDistance cylinderDistance(double radius, double length) {
  return [=](const Vector3& p) {
    const Eigen::Vector2d q(std::hypot(p.x(), p.y()) - radius, std::abs(p.z()) - length / 2);
    return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
  };
}

/// Range of the signed distance of points on the facets: corners, and barycentric combinations of them.
std::pair<double, double> distancesOfFacets(const TriangleMesh& mesh, const SignedDistance& distance) {
  std::pair<double, double> range{1e9, -1e9};
  constexpr int kSteps = 6;
  for (const auto& [a, b, c] : mesh.triangles) {
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; i + j <= kSteps; ++j) {
        const Vector3f p =
            (static_cast<float>(i) * mesh.vertices[a] + static_cast<float>(j) * mesh.vertices[b] +
             static_cast<float>(kSteps - i - j) * mesh.vertices[c]) /
            static_cast<float>(kSteps);
        const double d = distance(p.cast<double>());
        range = {std::min(range.first, d), std::max(range.second, d)};
      }
    }
  }
  return range;
}

TEST(Shapes, ABoxIsExact) {
  const Vector3 edges(0.02, 0.03, 0.25);
  const TriangleMesh mesh = makeBox(edges);
  EXPECT_EQ(mesh.triangles.size(), 12U);
  EXPECT_TRUE(isClosed(mesh));
  EXPECT_TRUE(sizeOf(mesh).isApprox(edges, kRounding));
  const Measured measured = measure(mesh);
  EXPECT_NEAR(measured.volume, edges.prod(), kRounding * edges.prod());
  EXPECT_NEAR(measured.area, 2 * (0.02 * 0.03 + 0.02 * 0.25 + 0.03 * 0.25), 1e-8);
  const auto [inside, outside] = distancesOfFacets(mesh, boxDistance(edges));
  EXPECT_NEAR(inside, 0.0, 1e-8);
  EXPECT_NEAR(outside, 0.0, 1e-8);
}

TEST(Shapes, ASphereLiesWithinItsDeviation) {
  for (const double radius : {0.0005, 0.012, 0.5}) {
    for (const double relative : {0.2, 0.05, 0.01, 1e-3}) {
      SCOPED_TRACE(testing::Message() << "radius " << radius << ", deviation / radius " << relative);
      const TriangleMesh mesh = makeSphere(radius, relative * radius);
      EXPECT_TRUE(isClosed(mesh));
      EXPECT_TRUE(sizeOf(mesh).isApprox(Vector3::Constant(2 * radius), kRounding));
      const auto [inside, outside] = distancesOfFacets(mesh, sphereDistance(radius));
      EXPECT_GE(inside, -(relative + kRounding) * radius);
      EXPECT_LE(outside, kRounding * radius);
      // between the sphere and the one that all facets enclose
      const Measured measured = measure(mesh);
      const double volume = 4.0 / 3.0 * pi * std::pow(radius, 3);
      EXPECT_LT(measured.volume, volume * (1 + 3 * kRounding));
      EXPECT_GT(measured.volume, volume * std::pow(1 - relative, 3));
      const double area = 4 * pi * radius * radius;
      EXPECT_LT(measured.area, area * (1 + 3 * kRounding));
      EXPECT_GT(measured.area, area * std::pow(1 - relative, 2));
    }
  }
}

TEST(Shapes, ASphereHasNoMoreTrianglesThanItsDeviationAsksFor) {
  // 2 pi r / (3 sqrt(3) d): equal triangles whose planes are at depth d; twice that is room for unequal ones
  // and even counts
  const double relative = 1e-3;
  EXPECT_LT(static_cast<double>(makeSphere(0.1, relative * 0.1).triangles.size()),
            2 * 4 * pi / (3 * std::sqrt(3.0) / 4 * 2 * relative));
}

TEST(Shapes, ACylinderLiesWithinItsDeviation) {
  for (const double radius : {0.0005, 0.012, 0.5}) {
    for (const double relative : {0.2, 0.05, 0.01, 1e-3, 1e-5}) {
      SCOPED_TRACE(testing::Message() << "radius " << radius << ", deviation / radius " << relative);
      const double length = 0.04;
      const TriangleMesh mesh = makeCylinder(radius, length, relative * radius);
      EXPECT_TRUE(isClosed(mesh));
      EXPECT_TRUE(sizeOf(mesh).isApprox(Vector3(2 * radius, 2 * radius, length), kRounding));
      const auto [inside, outside] = distancesOfFacets(mesh, cylinderDistance(radius, length));
      EXPECT_GE(inside, -(relative + kRounding) * radius);
      EXPECT_LE(outside, kRounding * radius);
      const Measured measured = measure(mesh);
      const double volume = pi * radius * radius * length;
      EXPECT_LT(measured.volume, volume * (1 + 3 * kRounding));
      EXPECT_GT(measured.volume, volume * std::pow(1 - relative, 2));
      const double area = 2 * pi * radius * (radius + length);
      EXPECT_LT(measured.area, area * (1 + 3 * kRounding));
      EXPECT_GT(measured.area, area * std::pow(1 - relative, 2));
    }
  }
}

class ShapeFile : public ::testing::Test {
 protected:
  ShapeFile() { std::filesystem::create_directories(folder_); }
  ~ShapeFile() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("tenon_shapes_" + std::to_string(getpid()));
};

TEST_F(ShapeFile, IsReadAgainAsTheSameMeshInAnyUnit) {
  const TriangleMesh mesh = makeCylinder(0.012, 0.04, 1e-4);
  for (const double unit : {1.0, 1e-3, 0.0254}) {
    const auto file = folder_ / "cylinder.stl";
    ASSERT_TRUE(writeStl(file, mesh, unit));
    const auto read = importMesh(file, unit);
    ASSERT_TRUE(read) << read.error().what;
    EXPECT_EQ(read->triangles.size(), mesh.triangles.size());
    EXPECT_NEAR(measure(*read).volume, measure(mesh).volume, kRounding * measure(mesh).volume);
    EXPECT_TRUE(sizeOf(*read).isApprox(sizeOf(mesh), kRounding));
  }
}

TEST_F(ShapeFile, AFolderThatIsNotThereIsAnErrorThatNamesTheFile) {
  const auto written = writeStl(folder_ / "none" / "box.stl", makeBox(Vector3::Ones()), 1.0);
  ASSERT_FALSE(written);
  EXPECT_THAT(written.error().what, ::testing::HasSubstr("none/box.stl"));
}

TEST(ShapeBake, FieldsOfShapesMeasureTheDistanceToTheSolid) {
  const double voxel = 0.001;
  const struct {
    TriangleMesh mesh;
    SignedDistance distance;
  } cases[] = {{makeBox(Vector3(0.02, 0.03, 0.04)), boxDistance(Vector3(0.02, 0.03, 0.04))},
               {makeSphere(0.012, 5e-5), sphereDistance(0.012)},
               {makeCylinder(0.008, 0.03, 5e-5), cylinderDistance(0.008, 0.03)}};
  for (const auto& [mesh, distance] : cases) {
    const auto baked = bake(mesh, {.voxel = voxel, .refinement = 1, .points = 500});
    ASSERT_TRUE(baked) << baked.error().what;
    EXPECT_EQ(baked->info.notes, "") << "a closed solid without faults";
    int compared = 0;
    for (double x = -0.016; x < 0.016; x += 0.0037) {
      for (double y = -0.018; y < 0.018; y += 0.0037) {
        for (double z = -0.023; z < 0.023; z += 0.0037) {
          const double truth = distance(Vector3(x, y, z));
          if (std::abs(truth) > 2 * voxel) continue;
          ++compared;
          // interpolation at edges is off by a fraction of a voxel
          EXPECT_NEAR(baked->field.sample(Vector3(x, y, z)).distance, truth, 0.3 * voxel)
              << x << " " << y << " " << z;
        }
      }
    }
    EXPECT_GT(compared, 30);
  }
}

}  // namespace
}  // namespace tenon::bake
