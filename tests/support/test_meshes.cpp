#include "tests/support/test_meshes.h"

#include <cmath>
#include <map>
#include <numbers>
#include <random>

namespace tenon::test {

bake::TriangleMesh ballMesh(double radius, int level, const Vector3& centre) {
  const double t = (1.0 + std::sqrt(5.0)) / 2.0;
  std::vector<Vector3> points{{-1, t, 0},  {1, t, 0},  {-1, -t, 0}, {1, -t, 0}, {0, -1, t},  {0, 1, t},
                              {0, -1, -t}, {0, 1, -t}, {t, 0, -1},  {t, 0, 1},  {-t, 0, -1}, {-t, 0, 1}};
  std::vector<std::array<std::uint32_t, 3>> faces{
      {0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
      {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
      {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  for (int i = 0; i < level; ++i) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> midpoints;
    const auto midpoint = [&](std::uint32_t a, std::uint32_t b) {
      const auto [entry, is_new] =
          midpoints.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(points.size()));
      if (is_new) points.push_back(points[a].normalized() + points[b].normalized());
      return entry->second;
    };
    std::vector<std::array<std::uint32_t, 3>> finer;
    for (const auto& [a, b, c] : faces) {
      const std::uint32_t ab = midpoint(a, b);
      const std::uint32_t bc = midpoint(b, c);
      const std::uint32_t ca = midpoint(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    faces = std::move(finer);
  }
  bake::TriangleMesh mesh;
  for (const Vector3& p : points) mesh.vertices.push_back((centre + p.normalized() * radius).cast<float>());
  mesh.triangles = faces;
  return mesh;
}

bake::TriangleMesh boxMesh(const Vector3& from, const Vector3& to) {
  bake::TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    const Vector3 p((i & 1) != 0 ? to.x() : from.x(), (i & 2) != 0 ? to.y() : from.y(),
                    (i & 4) != 0 ? to.z() : from.z());
    mesh.vertices.push_back(p.cast<float>());
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

bake::TriangleMesh torusMesh(double ring, double tube, int around_ring, int around_tube) {
  bake::TriangleMesh mesh;
  const auto at = [&](int i, int k) {
    return static_cast<std::uint32_t>(i % around_ring * around_tube + k % around_tube);
  };
  for (int i = 0; i < around_ring; ++i) {
    const double u = 2.0 * std::numbers::pi * i / around_ring;
    for (int k = 0; k < around_tube; ++k) {
      const double v = 2.0 * std::numbers::pi * k / around_tube;
      const double r = ring + tube * std::cos(v);
      mesh.vertices.push_back(Vector3(r * std::cos(u), r * std::sin(u), tube * std::sin(v)).cast<float>());
      mesh.triangles.push_back({at(i, k), at(i + 1, k), at(i + 1, k + 1)});
      mesh.triangles.push_back({at(i, k), at(i + 1, k + 1), at(i, k + 1)});
    }
  }
  return mesh;
}

bake::TriangleMesh sheetMesh(double half_edge, double z, int n) {
  bake::TriangleMesh mesh;
  const auto at = [n](int i, int k) { return static_cast<std::uint32_t>(i * (n + 1) + k); };
  for (int i = 0; i <= n; ++i) {
    for (int k = 0; k <= n; ++k) {
      const Vector3 p(half_edge * (2.0 * i / n - 1.0), half_edge * (2.0 * k / n - 1.0), z);
      mesh.vertices.push_back(p.cast<float>());
      if (i == n || k == n) continue;
      mesh.triangles.push_back({at(i, k), at(i + 1, k), at(i + 1, k + 1)});
      mesh.triangles.push_back({at(i, k), at(i + 1, k + 1), at(i, k + 1)});
    }
  }
  return mesh;
}

bake::TriangleMesh together(const bake::TriangleMesh& a, const bake::TriangleMesh& b) {
  bake::TriangleMesh mesh = a;
  const auto first = static_cast<std::uint32_t>(a.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const auto& [i, j, k] : b.triangles) mesh.triangles.push_back({i + first, j + first, k + first});
  return mesh;
}

bake::TriangleMesh randomlyFlipped(bake::TriangleMesh mesh, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  for (auto& triangle : mesh.triangles) {
    if ((random() >> 40U & 1U) != 0) std::swap(triangle[1], triangle[2]);
  }
  return mesh;
}

}  // namespace tenon::test
