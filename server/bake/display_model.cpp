#include "server/bake/display_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include <meshoptimizer.h>

#include "server/bake/glb.h"

namespace tenon::bake {
namespace {

constexpr double kCreaseCosine = 0.819;  // [-] of 35 degrees between the normals of two faces

/// Triangles of shared vertices, y up. A vertex has one colour: where two meet there are two vertices.
struct IndexedMesh {
  std::vector<Vector3f> positions;    // [m]
  std::vector<std::uint32_t> colors;  // 0xRRGGBB, sRGB, of each vertex; empty without colours
  std::vector<std::uint32_t> indices;
};

/// A corner of a triangle, as meshoptimizer compares them: by their bytes.
struct Corner {
  Vector3f position;
  std::uint32_t color = 0;
};
static_assert(sizeof(Corner) == 16);

IndexedMesh indexed(const TriangleMesh& mesh, std::uint32_t uncolored) {
  std::vector<Corner> corners;
  corners.reserve(3 * mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const std::uint32_t own = mesh.colors.empty() ? 0 : mesh.colors[i];
    for (const std::uint32_t vertex : mesh.triangles[i]) {
      const Vector3f& p = mesh.vertices[vertex];
      // + 0: so that a negative zero equals a positive one
      corners.push_back({{p.x() + 0.0F, p.z() + 0.0F, -p.y() + 0.0F}, own == kNoColor ? uncolored : own});
    }
  }
  std::vector<std::uint32_t> remap(corners.size());
  const std::size_t unique = meshopt_generateVertexRemap(remap.data(), nullptr, corners.size(),
                                                         corners.data(), corners.size(), sizeof(Corner));
  IndexedMesh welded;
  welded.positions.resize(unique);
  if (!mesh.colors.empty()) welded.colors.resize(unique);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    welded.positions[remap[i]] = corners[i].position;
    if (!mesh.colors.empty()) welded.colors[remap[i]] = corners[i].color;
  }
  for (std::size_t i = 0; i + 2 < corners.size(); i += 3) {
    const std::uint32_t first = remap[i];
    const std::uint32_t second = remap[i + 1];
    const std::uint32_t third = remap[i + 2];
    if (first != second && second != third && third != first)
      welded.indices.insert(welded.indices.end(), {first, second, third});
  }
  return welded;
}

/// At most `triangles` where the mesh's topology permits; returns the estimated deviation [m].
double simplify(IndexedMesh& mesh, std::size_t triangles) {
  if (mesh.indices.size() <= 3 * triangles) return 0.0;
  std::vector<std::uint32_t> fewer(mesh.indices.size());
  const float* positions = mesh.positions.front().data();
  float error = 0.0F;
  fewer.resize(meshopt_simplify(fewer.data(), mesh.indices.data(), mesh.indices.size(), positions,
                                mesh.positions.size(), sizeof(Vector3f), 3 * triangles, 1.0F, 0, &error));
  mesh.indices = std::move(fewer);
  return static_cast<double>(error *
                             meshopt_simplifyScale(positions, mesh.positions.size(), sizeof(Vector3f)));
}

/// Twice the area times the unit normal of each triangle.
std::vector<Vector3f> faceNormals(const IndexedMesh& mesh) {
  std::vector<Vector3f> normals;
  normals.reserve(mesh.indices.size() / 3);
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    const Vector3f& a = mesh.positions[mesh.indices[i]];
    const Vector3f ab = mesh.positions[mesh.indices[i + 1]] - a;
    normals.emplace_back(ab.cross(mesh.positions[mesh.indices[i + 2]] - a));
  }
  return normals;
}

/// The normals of all faces, and the faces of each vertex.
struct FaceNormals {
  explicit FaceNormals(const IndexedMesh& mesh)
      : normals(faceNormals(mesh)), first(mesh.positions.size() + 1) {
    for (const std::uint32_t vertex : mesh.indices) ++first[vertex + 1];
    for (std::size_t i = 1; i < first.size(); ++i) first[i] += first[i - 1];
    std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
    faces.resize(mesh.indices.size());
    for (std::size_t i = 0; i < mesh.indices.size(); ++i)
      faces[next[mesh.indices[i]]++] = static_cast<std::uint32_t>(i / 3);
  }

  /// The normal at a vertex of the surface that faces `direction`: the mean of the faces there that are
  /// smoothly connected to the one whose normal is the nearest.
  [[nodiscard]] Vector3f at(std::uint32_t vertex, const Vector3f& direction) const {
    Vector3f nearest = Vector3f::Zero();
    float cosine = -2.0F;
    for (std::uint32_t i = first[vertex]; i < first[vertex + 1]; ++i) {
      const Vector3f normal = normals[faces[i]].normalized();
      if (normal.dot(direction) <= cosine) continue;
      cosine = normal.dot(direction);
      nearest = normal;
    }
    Vector3f sum = Vector3f::Zero();
    for (std::uint32_t i = first[vertex]; i < first[vertex + 1]; ++i) {
      const Vector3f& other = normals[faces[i]];
      if (other.dot(nearest) >= static_cast<float>(kCreaseCosine) * other.norm()) sum += other;
    }
    return sum.squaredNorm() > 0.0F ? sum.normalized() : nearest;
  }

  std::vector<Vector3f> normals;
  std::vector<std::uint32_t> first;  ///< of a vertex, in `faces`
  std::vector<std::uint32_t> faces;
};

/// The linear parts of an sRGB colour (IEC 61966-2-1), as glTF demands them, opaque.
std::array<std::uint16_t, 4> linear(std::uint32_t color) {
  constexpr double kMost = std::numeric_limits<std::uint16_t>::max();
  const auto part = [&](std::uint32_t shift) {
    const double srgb = static_cast<double>(color >> shift & 0xFFU) / 255.0;
    const double value = srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
    return static_cast<std::uint16_t>(std::lround(kMost * value));
  };
  return {part(16), part(8), part(0), std::numeric_limits<std::uint16_t>::max()};
}

/// `surface`: of the mesh before it was simplified, whose vertices are a part of its; the faces of a
/// simplified mesh are slivers here and there, whose normals mean nothing.
GlbMesh quantised(const IndexedMesh& mesh, const FaceNormals& surface) {
  Eigen::AlignedBox3f box;
  for (const std::uint32_t vertex : mesh.indices) box.extend(mesh.positions[vertex]);
  GlbMesh glb;
  glb.has_colors = !mesh.colors.empty();
  glb.origin = box.min().cast<double>();
  glb.step =
      std::max(1e-9, static_cast<double>(box.sizes().maxCoeff())) / std::numeric_limits<std::uint16_t>::max();
  const std::vector<Vector3f> normals = faceNormals(mesh);
  std::map<std::tuple<std::uint32_t, std::int8_t, std::int8_t, std::int8_t>, std::uint32_t> known;
  for (std::size_t i = 0; i < mesh.indices.size(); ++i) {
    const std::uint32_t vertex = mesh.indices[i];
    const Vector3f normal = surface.at(vertex, normals[i / 3].normalized());
    GlbVertex made;
    for (int axis = 0; axis < 3; ++axis) {
      const auto at = static_cast<std::size_t>(axis);
      made.position[at] = static_cast<std::uint16_t>(
          std::lround((static_cast<double>(mesh.positions[vertex][axis]) - glb.origin[axis]) / glb.step));
      made.normal[at] = static_cast<std::int8_t>(std::lround(127.0F * normal[axis]));
    }
    if (glb.has_colors) made.color = linear(mesh.colors[vertex]);
    const auto [entry, is_new] = known.try_emplace({vertex, made.normal[0], made.normal[1], made.normal[2]},
                                                   static_cast<std::uint32_t>(glb.vertices.size()));
    if (is_new) glb.vertices.push_back(made);
    glb.indices.push_back(entry->second);
  }
  // an order that is drawn fast and compresses well
  meshopt_optimizeVertexCache(glb.indices.data(), glb.indices.data(), glb.indices.size(),
                              glb.vertices.size());
  std::vector<GlbVertex> ordered(glb.vertices.size());
  ordered.resize(meshopt_optimizeVertexFetch(ordered.data(), glb.indices.data(), glb.indices.size(),
                                             glb.vertices.data(), glb.vertices.size(), sizeof(GlbVertex)));
  glb.vertices = std::move(ordered);
  return glb;
}

}  // namespace

Result<std::vector<DisplayModel>> displayModels(const TriangleMesh& mesh, std::uint32_t uncolored) {
  const IndexedMesh whole = mesh.triangles.empty() ? IndexedMesh{} : indexed(mesh, uncolored);
  if (whole.indices.empty()) return fail("the mesh has no triangle with an area");
  const FaceNormals surface(whole);
  std::vector<DisplayModel> models;
  for (const std::uint32_t limit : kDisplayTriangles) {
    IndexedMesh level = whole;
    const double error = simplify(level, limit);
    const auto triangles = static_cast<std::uint32_t>(level.indices.size() / 3);
    if (!models.empty() && (triangles == 0 || triangles == models.back().triangles)) break;
    models.push_back({writeGlb(quantised(level, surface)), triangles, error});
  }
  return models;
}

}  // namespace tenon::bake
