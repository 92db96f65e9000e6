#include "server/bake/shapes.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <map>
#include <utility>

#include <unistd.h>

namespace tenon::bake {
namespace {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

/// The vertices of an icosahedron with edge 2: cyclic permutations of (0, +-1, +-golden ratio).
std::array<Vector3, 12> icosahedronVertices() {
  const double golden = (1.0 + std::sqrt(5.0)) / 2;
  std::array<Vector3, 12> vertices;
  std::size_t next = 0;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double one : {-1.0, 1.0}) {
      for (const double long_one : {-golden, golden}) {
        Vector3& v = vertices[next++];
        v[axis] = 0.0;
        v[(axis + 1) % 3] = one;
        v[(axis + 2) % 3] = long_one;
      }
    }
  }
  return vertices;
}

/// Its 20 faces, counter-clockwise seen from outside: the triples of vertices at the distance of an edge.
Triangles icosahedronFaces(const std::array<Vector3, 12>& vertices) {
  const auto isEdge = [&](std::uint32_t a, std::uint32_t b) {
    return (vertices[a] - vertices[b]).squaredNorm() < 5.0;  // 4 along an edge, 10.5 across
  };
  Triangles faces;
  for (std::uint32_t a = 0; a < 12; ++a) {
    for (std::uint32_t b = a + 1; b < 12; ++b) {
      for (std::uint32_t c = b + 1; c < 12; ++c) {
        if (!isEdge(a, b) || !isEdge(b, c) || !isEdge(a, c)) continue;
        const bool outward = vertices[a].cross(vertices[b]).dot(vertices[c]) > 0.0;
        faces.push_back(outward ? std::array{a, b, c} : std::array{a, c, b});
      }
    }
  }
  return faces;
}

/// Points of an icosahedron's faces, each once although neighbouring faces share it.
class FacePoints {
 public:
  /// Weight of each corner, by its number; three that add up to the frequency.
  using Weights = std::array<std::pair<std::uint32_t, int>, 3>;

  FacePoints(const std::array<Vector3, 12>& corners, double radius) : corners_(corners), radius_(radius) {}

  std::uint32_t number(Weights weights) {
    for (auto& [corner, weight] : weights) {
      if (weight == 0) corner = 0;  // it has no part in the point
    }
    std::sort(weights.begin(), weights.end());
    const auto [found, is_new] = numbers_.try_emplace(weights, static_cast<std::uint32_t>(points_.size()));
    if (is_new) {
      Vector3 p = Vector3::Zero();
      for (const auto& [corner, weight] : weights) p += static_cast<double>(weight) * corners_[corner];
      points_.push_back((radius_ / p.norm() * p).cast<float>());
    }
    return found->second;
  }
  std::vector<Vector3f> takePoints() { return std::move(points_); }

 private:
  const std::array<Vector3, 12>& corners_;
  double radius_;
  std::map<Weights, std::uint32_t> numbers_;
  std::vector<Vector3f> points_;
};

/// Into how many parts each edge of an icosahedron is divided so that facets stay within the deviation. The
/// largest facets are at the middles of the icosahedron's faces, where the projection enlarges them by
/// circumradius / inradius; a facet with circumradius R lies 1 - sqrt(1 - R^2) below a unit sphere. Even, so
/// that there are vertices on the axes.
int sphereFrequency(double relative_deviation) {
  constexpr double kEdge = 1.0514622242382672;      // [-] of an icosahedron of circumradius 1
  constexpr double kInradius = 0.7946544722917661;  // [-] likewise
  const double largest = std::sqrt(relative_deviation * (2.0 - relative_deviation));
  const int frequency = static_cast<int>(std::ceil(kEdge / (std::sqrt(3.0) * kInradius * largest)));
  return std::max(2, frequency + frequency % 2);
}

/// Corners of a regular polygon in the unit circle, counter-clockwise from +x, on the axes among others. Arcs
/// are bisected until the edges are within the deviation.
std::vector<Eigen::Vector2d> unitPolygon(double relative_deviation) {
  std::vector<Eigen::Vector2d> corners{{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
  double apothem = std::sqrt(0.5);
  while (1.0 - apothem > relative_deviation) {
    std::vector<Eigen::Vector2d> finer;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      finer.push_back(corners[i]);
      finer.emplace_back((corners[i] + corners[(i + 1) % corners.size()]).normalized());
    }
    corners = std::move(finer);
    apothem = std::sqrt((1.0 + apothem) / 2);  // cosine of half the angle
  }
  return corners;
}

void append(std::vector<char>& bytes, const Vector3f& v) {
  static_assert(std::endian::native == std::endian::little);  // as STL is
  const std::size_t at = bytes.size();
  bytes.resize(at + 3 * sizeof(float));
  std::memcpy(bytes.data() + at, v.data(), 3 * sizeof(float));
}

}  // namespace

TriangleMesh makeBox(const Vector3& edges) {
  assert((edges.array() > 0.0).all());
  TriangleMesh mesh;
  for (const double z : {-0.5, 0.5}) {
    for (const double y : {-0.5, 0.5}) {
      for (const double x : {-0.5, 0.5})
        mesh.vertices.push_back(Vector3(x, y, z).cwiseProduct(edges).cast<float>());
    }
  }
  // sides x, y, z: low, then high; four corners counter-clockwise seen from outside
  constexpr std::array<std::array<std::uint32_t, 4>, 6> kSides{
      {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}};
  for (const auto& [a, b, c, d] : kSides) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  }
  return mesh;
}

TriangleMesh makeSphere(double radius, double deviation) {
  assert(radius > 0.0 && deviation > 0.0 && deviation < radius);
  const std::array<Vector3, 12> corners = icosahedronVertices();
  const int n = sphereFrequency(deviation / radius);
  FacePoints points(corners, radius);
  TriangleMesh mesh;
  for (const auto& [a, b, c] : icosahedronFaces(corners)) {
    // point (i, j) of a face: i steps from a to b, j steps from a to c
    const auto point = [&, a = a, b = b, c = c](int i, int j) {
      return points.number({{{a, n - i - j}, {b, i}, {c, j}}});
    };
    for (int i = 0; i < n; ++i) {
      for (int j = 0; i + j < n; ++j) {
        mesh.triangles.push_back({point(i, j), point(i + 1, j), point(i, j + 1)});
        if (i + j + 1 < n) mesh.triangles.push_back({point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)});
      }
    }
  }
  mesh.vertices = points.takePoints();
  return mesh;
}

TriangleMesh makeCylinder(double radius, double length, double deviation) {
  assert(radius > 0.0 && length > 0.0 && deviation > 0.0 && deviation < radius);
  const std::vector<Eigen::Vector2d> polygon = unitPolygon(deviation / radius);
  const auto n = static_cast<std::uint32_t>(polygon.size());
  TriangleMesh mesh;
  // vertices: the polygon below and above, then the centres of both ends
  for (const double z : {-length / 2, length / 2}) {
    for (const Eigen::Vector2d& corner : polygon)
      mesh.vertices.push_back(Vector3(radius * corner.x(), radius * corner.y(), z).cast<float>());
  }
  for (const double z : {-length / 2, length / 2})
    mesh.vertices.push_back(Vector3(0.0, 0.0, z).cast<float>());
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t next = (i + 1) % n;
    mesh.triangles.push_back({i, next, n + next});
    mesh.triangles.push_back({i, n + next, n + i});
    mesh.triangles.push_back({2 * n, next, i});
    mesh.triangles.push_back({2 * n + 1, n + i, n + next});
  }
  return mesh;
}

Result<void> writeStl(const std::filesystem::path& file, const TriangleMesh& mesh, double unit) {
  std::vector<char> bytes(80, ' ');
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  bytes.resize(84);
  std::memcpy(bytes.data() + 80, &count, sizeof count);
  for (const auto& triangle : mesh.triangles) {
    append(bytes, Vector3f::Zero());  // no normal: readers compute it from the corners
    for (const std::uint32_t corner : triangle)
      append(bytes, (mesh.vertices[corner].cast<double>() / unit).cast<float>());
    bytes.resize(bytes.size() + 2);  // attributes
  }
  const std::filesystem::path temporary = file.string() + "." + std::to_string(getpid());
  std::ofstream(temporary, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  std::error_code error;
  const bool whole = std::filesystem::file_size(temporary, error) == bytes.size() && !error;
  if (whole) std::filesystem::rename(temporary, file, error);
  if (!whole || error) return fail(file.string() + ": cannot be written, is the disk full?");
  return {};
}

}  // namespace tenon::bake
