#include "scenarios/part_generator/mesh.h"

#include <cstring>
#include <fstream>

#include <fmt/format.h>

namespace tenon::part_generator {
namespace {

constexpr double kMillimetre = 1e-3;

/// Whether the ray from p along a fixed oblique direction crosses the triangle (Möller and Trumbore 1997).
bool rayCrosses(const std::array<Vector3, 3>& triangle, const Vector3& p) {
  // oblique: not parallel to the axis-aligned faces that parts have
  const Vector3 direction(0.5317, 0.3119, 0.7874);
  const Vector3 edge1 = triangle[1] - triangle[0];
  const Vector3 edge2 = triangle[2] - triangle[0];
  const Vector3 h = direction.cross(edge2);
  const double determinant = edge1.dot(h);
  if (determinant == 0.0) return false;
  const Vector3 s = p - triangle[0];
  const double u = s.dot(h) / determinant;
  if (u < 0.0 || u > 1.0) return false;
  const Vector3 q = s.cross(edge1);
  const double v = direction.dot(q) / determinant;
  return v >= 0.0 && u + v <= 1.0 && edge2.dot(q) / determinant > 0.0;
}

void append(std::vector<char>& bytes, const void* data, std::size_t size) {
  const auto* from = static_cast<const char*>(data);
  bytes.insert(bytes.end(), from, from + size);
}

/// The attribute of an STL facet as most viewers and assimp read it: bit 15 says that it is a colour, of 5
/// bits each for red, green and blue; 0: none.
std::uint16_t attributeOf(Color color) {
  if (color == kUnpainted) return 0;
  std::uint32_t bits = 1;
  for (const std::uint32_t shift : {16U, 8U, 0U})
    bits = bits << 5U | (((color >> shift & 0xFFU) * 31 + 127) / 255);
  return static_cast<std::uint16_t>(bits);
}

void append(std::vector<char>& bytes, const Vector3f& v) { append(bytes, v.data(), 3 * sizeof(float)); }

}  // namespace

Eigen::AlignedBox3d PartMesh::box() const {
  Eigen::AlignedBox3d box;
  for (const auto& triangle : triangles) {
    for (const Vector3& corner : triangle) box.extend(corner);
  }
  return box;
}

bool insideAnyShell(const PartMesh& mesh, const Vector3& p_MP) {
  for (const PartMesh::Shell& shell : mesh.shells) {
    if (!shell.closed) continue;
    bool inside = false;
    for (std::size_t i = shell.first; i < shell.first + shell.count; ++i) {
      if (rayCrosses(mesh.triangles[i], p_MP)) inside = !inside;
    }
    if (inside) return true;
  }
  return false;
}

Result<void> writeStl(const std::filesystem::path& file, const PartMesh& mesh) {
  std::vector<char> bytes(80, ' ');
  bytes.reserve(84 + 50 * mesh.triangles.size());
  std::memcpy(bytes.data(), "tenon part, millimetres", 23);
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  append(bytes, &count, sizeof count);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const std::array<Vector3, 3>& triangle = mesh.triangles[i];
    const Vector3 normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
    const double length = normal.norm();
    append(bytes, length > 0.0 ? Vector3f((normal / length).cast<float>()) : Vector3f::Zero());
    for (const Vector3& corner : triangle) append(bytes, Vector3f((corner / kMillimetre).cast<float>()));
    const std::uint16_t attribute = i < mesh.paint.size() ? attributeOf(mesh.paint[i]) : std::uint16_t{0};
    append(bytes, &attribute, sizeof attribute);
  }
  std::ofstream out(file, std::ios::binary);
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  out.close();
  if (!out)
    return fail(
        fmt::format("{}: cannot be written; expected an existing folder with free space", file.string()));
  return {};
}

}  // namespace tenon::part_generator
