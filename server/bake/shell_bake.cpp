#include "server/bake/shell_bake.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "server/bake/normal_estimator.h"
#include "server/bake/parallel.h"
#include "server/structures/point_grid.h"
#include "server/structures/shell_builder.h"

namespace tenon::bake {

namespace {

// Candidates per selected point: more candidates give a more even sampling, and take longer.
constexpr std::size_t kCandidatesPerPoint = 12;
constexpr std::size_t kMaxCandidates = 12'000'000;
// Points per area r^2 of a dense random sampling with minimum distance r (maximal Poisson-disk sampling).
constexpr double kDiscsPerArea = 0.59;

/// The k-th number of a fixed random sequence in [0, 1) (splitmix64).
double randomUnit(std::uint64_t k) {
  std::uint64_t z = (k + 1) * 0x9E3779B97F4A7C15ULL;
  z = (z ^ z >> 30U) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ z >> 27U) * 0x94D049BB133111EBULL;
  return static_cast<double>((z ^ z >> 31U) >> 11U) * 0x1p-53;
}

Vector3 unitNormal(const structures::Triangle& t) { return (t[1] - t[0]).cross(t[2] - t[0]).normalized(); }

/// Samples at corners, then along sharp convex edges at most `spacing` [m] apart.
std::vector<structures::SurfaceSample> edgeSamples(const WeldedMesh& mesh, const NormalEstimator& normals,
                                                   double spacing) {
  std::vector<structures::SurfaceSample> samples;
  std::vector<std::vector<Vector3>> directions(mesh.positions.size());
  const auto add = [&](const Vector3& p, const Vector3& into) {
    if (normals.onSurface(p)) samples.push_back({p, normals.inward(p, into), 0.0});
  };
  std::vector<WeldedMesh::Edge> convex;
  std::vector<Vector3> inwards;
  for (const WeldedMesh::Edge& edge : mesh.sharpEdges()) {
    const Vector3& a = mesh.positions[edge.from];
    const Vector3& b = mesh.positions[edge.to];
    const Vector3 middle = (a + b) / 2;
    // the sum of the directions to both faces' centres is about the bisector
    const auto towards = [&](std::uint32_t triangle) {
      const structures::Triangle& t = mesh.triangles[triangle];
      const Vector3 to = (t[0] + t[1] + t[2]) / 3.0 - middle;
      const Vector3 along = (b - a).normalized();
      return Vector3((to - along * along.dot(to)).normalized());
    };
    Vector3 into = towards(edge.first);
    if (edge.second != WeldedMesh::Edge::kNone) into += towards(edge.second);
    if (!(into.norm() > 1e-6)) continue;
    into.normalize();
    if (edge.second != WeldedMesh::Edge::kNone && !normals.convex(middle, into)) continue;
    directions[edge.from].push_back((b - a).normalized());
    directions[edge.to].push_back((a - b).normalized());
    convex.push_back(edge);
    inwards.push_back(into);
  }
  for (std::size_t corner = 0; corner < directions.size(); ++corner) {
    const auto& edges = directions[corner];
    const bool straight = edges.size() == 2 && edges[0].dot(edges[1]) < -0.9;
    if (edges.empty() || straight) continue;
    const Vector3 sum = std::accumulate(edges.begin(), edges.end(), Vector3(Vector3::Zero()));
    if (sum.norm() > 1e-6) add(mesh.positions[corner], sum.normalized());
  }
  for (std::size_t i = 0; i < convex.size(); ++i) {
    const Vector3& a = mesh.positions[convex[i].from];
    const Vector3& b = mesh.positions[convex[i].to];
    const int steps = std::max(1, static_cast<int>(std::ceil((b - a).norm() / spacing)));
    for (int k = 0; k < steps; ++k) add(a + (b - a) * ((k + 0.5) / steps), inwards[i]);
  }
  return samples;
}

/// `count` samples of the surface, stratified by area (one in each equal part), in random order.
std::vector<structures::SurfaceSample> faceSamples(std::span<const structures::Triangle> surface, double area,
                                                   std::size_t count, const NormalEstimator& normals,
                                                   ParallelWork& work) {
  std::vector<std::uint32_t> triangle_of(count);
  std::size_t next = 0;
  double covered = 0.0;
  for (std::uint32_t i = 0; i < surface.size(); ++i) {
    covered += structures::areaOf(surface[i]);
    while (next < count && (static_cast<double>(next) + randomUnit(3 * next)) * area <=
                               covered * static_cast<double>(count)) {
      triangle_of[next++] = i;
    }
  }
  std::fill(triangle_of.begin() + static_cast<std::ptrdiff_t>(next), triangle_of.end(),
            static_cast<std::uint32_t>(surface.size() - 1));
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0U);
  for (std::size_t i = count; i > 1; --i) {
    std::swap(order[i - 1],
              order[static_cast<std::size_t>(randomUnit(7 * count + i) * static_cast<double>(i))]);
  }
  std::vector<structures::SurfaceSample> samples(count);
  work.run(count, 4096, [&](std::size_t i) {
    const std::size_t k = order[i];
    const structures::Triangle& t = surface[triangle_of[k]];
    const double root = std::sqrt(randomUnit(3 * k + 1));
    const double along = randomUnit(3 * k + 2);
    const Vector3 p = t[0] * (1.0 - root) + t[1] * (root * (1.0 - along)) + t[2] * (root * along);
    samples[i] = {p, normals.inward(p, unitNormal(t)), area / static_cast<double>(count)};
  });
  return samples;
}

bool sameSide(const structures::SurfaceSample& a, const structures::SurfaceSample& b) {
  return a.inward_M.dot(b.inward_M) >= 0.0;
}

/// Poisson-disk sampling by dart throwing: keeps samples at least `apart` [m] from every earlier one on the
/// same side. The area of each candidate is added to the nearest kept sample.
std::vector<structures::SurfaceSample> poissonDiskSubset(
    const std::vector<structures::SurfaceSample>& samples, double apart) {
  std::vector<structures::SurfaceSample> kept;
  structures::PointGrid grid(apart);
  for (const structures::SurfaceSample& sample : samples) {
    const bool free = grid.visitNear(sample.p_MP, [&](std::uint32_t other, double squared) {
      return squared >= apart * apart || !sameSide(kept[other], sample);
    });
    if (!free) continue;
    grid.add(sample.p_MP, static_cast<std::uint32_t>(kept.size()));
    kept.push_back(sample);
    kept.back().area = 0.0;
  }
  for (const structures::SurfaceSample& sample : samples) {
    if (sample.area == 0.0) continue;
    double nearest = std::numeric_limits<double>::infinity();
    std::uint32_t owner = 0;
    grid.visitNear(sample.p_MP, [&](std::uint32_t other, double squared) {
      if (squared < nearest && sameSide(kept[other], sample)) {
        nearest = squared;
        owner = other;
      }
      return true;
    });
    kept[owner].area += sample.area;
  }
  return kept;
}

}  // namespace

structures::Pointshell bakeShell(const WeldedMesh& mesh, std::span<const structures::Triangle> surface,
                                 const structures::DistanceField& field, const BakeOptions& options,
                                 ParallelWork& work) {
  if (surface.empty()) return {};
  const double area =
      std::accumulate(surface.begin(), surface.end(), 0.0,
                      [](double sum, const structures::Triangle& t) { return sum + structures::areaOf(t); });
  const double wanted = options.point_spacing > 0.0 ? area / (options.point_spacing * options.point_spacing)
                                                    : static_cast<double>(options.points);
  const double spacing = std::sqrt(area / std::max(wanted, 1.0));
  const double apart = spacing * std::sqrt(kDiscsPerArea);
  const auto candidates = static_cast<std::size_t>(std::ceil(wanted)) * kCandidatesPerPoint;

  const NormalEstimator normals(field);
  std::vector<structures::SurfaceSample> samples = edgeSamples(mesh, normals, apart);
  const auto faces = faceSamples(surface, area, std::min(candidates, kMaxCandidates), normals, work);
  samples.insert(samples.end(), faces.begin(), faces.end());
  return structures::buildShell(poissonDiskSubset(samples, apart), apart);
}

}  // namespace tenon::bake
