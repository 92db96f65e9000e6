#include "server/bake/shell_bake.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "server/bake/parallel.h"
#include "server/structures/point_grid.h"
#include "server/structures/shell_builder.h"

namespace tenon {

namespace {

// Candidates for each point that is kept: more are more even, and slower.
constexpr std::size_t kCandidatesPerPoint = 12;
constexpr std::size_t kMaxCandidates = 12'000'000;
// Of randomly placed points, each at least r from all others, about so many find room on an area of r^2.
constexpr double kDiscsPerArea = 0.59;
// Below this the gradient is that of a medial axis, not of a surface.
constexpr double kLeastGradient = 0.3;

/// The k-th number of a fixed random sequence in [0, 1) (splitmix64).
double randomUnit(std::uint64_t k) {
  std::uint64_t z = (k + 1) * 0x9E3779B97F4A7C15ULL;
  z = (z ^ z >> 30U) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ z >> 27U) * 0x94D049BB133111EBULL;
  return static_cast<double>((z ^ z >> 31U) >> 11U) * 0x1p-53;
}

/// Turns places on the surface into sites with an inward normal.
class Orienter {
 public:
  explicit Orienter(const DistanceField& field) : field_(field) {}

  /// `normal_M` either way round: it decides only where the field cannot, and keeps its side on a sheet.
  [[nodiscard]] Vector3 inward(const Vector3& p_MP, const Vector3& normal_M) const {
    // the side is asked for at a distance: in a thin plate the gradient may be that of the other face
    const Vector3 step = normal_M * (0.75 * field_.voxelAt(p_MP));
    const bool outwards = field_.sample(p_MP + step).distance >= field_.sample(p_MP - step).distance;
    const Vector3 inward_M = outwards ? Vector3(-normal_M) : normal_M;
    const FieldSample sample = field_.sample(p_MP);
    const double slope = sample.gradient.norm();
    if (!sample.exact || slope < kLeastGradient || -sample.gradient.dot(inward_M) < 0.5 * slope)
      return inward_M;
    return -sample.gradient / slope;
  }

  [[nodiscard]] bool onSkin(const Vector3& p_MP) const {
    return field_.sample(p_MP).distance > -0.5 * field_.voxelAt(p_MP);
  }

  /// Whether the solid is on the narrow side of an edge: `into_M` halves the angle between its faces.
  [[nodiscard]] bool convex(const Vector3& p_MP, const Vector3& into_M) const {
    const Vector3 step = into_M * (0.5 * field_.voxelAt(p_MP));
    return field_.sample(p_MP + step).distance <= field_.sample(p_MP - step).distance;
  }

 private:
  const DistanceField& field_;
};

Vector3 unitNormal(const Triangle& t) { return (t[1] - t[0]).cross(t[2] - t[0]).normalized(); }

/// Corners, then points along edges no further apart than `spacing`.
std::vector<ShellSite> edgeSites(const WeldedMesh& mesh, const Orienter& orienter, double spacing) {
  std::vector<ShellSite> sites;
  std::vector<std::vector<Vector3>> directions(mesh.positions.size());
  const auto add = [&](const Vector3& p, const Vector3& into) {
    if (orienter.onSkin(p)) sites.push_back({p, orienter.inward(p, into), 0.0});
  };
  std::vector<WeldedMesh::Edge> convex;
  std::vector<Vector3> inwards;
  for (const WeldedMesh::Edge& edge : mesh.sharpEdges()) {
    const Vector3& a = mesh.positions[edge.from];
    const Vector3& b = mesh.positions[edge.to];
    const Vector3 middle = (a + b) / 2;
    // towards the middle of the faces: halves their angle well enough to tell its side
    const auto towards = [&](std::uint32_t triangle) {
      const Triangle& t = mesh.triangles[triangle];
      const Vector3 to = (t[0] + t[1] + t[2]) / 3.0 - middle;
      const Vector3 along = (b - a).normalized();
      return Vector3((to - along * along.dot(to)).normalized());
    };
    Vector3 into = towards(edge.first);
    if (edge.second != WeldedMesh::Edge::kNone) into += towards(edge.second);
    if (!(into.norm() > 1e-6)) continue;
    into.normalize();
    if (edge.second != WeldedMesh::Edge::kNone && !orienter.convex(middle, into)) continue;
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
  return sites;
}

/// `count` places spread over the surface, one in each equal share of its area, in random order.
std::vector<ShellSite> faceSites(std::span<const Triangle> surface, double area, std::size_t count,
                                 const Orienter& orienter, ParallelWork& work) {
  std::vector<std::uint32_t> triangle_of(count);
  std::size_t next = 0;
  double covered = 0.0;
  for (std::uint32_t i = 0; i < surface.size(); ++i) {
    covered += areaOf(surface[i]);
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
  std::vector<ShellSite> sites(count);
  work.run(count, 4096, [&](std::size_t place) {
    const std::size_t k = order[place];
    const Triangle& t = surface[triangle_of[k]];
    const double root = std::sqrt(randomUnit(3 * k + 1));
    const double along = randomUnit(3 * k + 2);
    const Vector3 p = t[0] * (1.0 - root) + t[1] * (root * (1.0 - along)) + t[2] * (root * along);
    sites[place] = {p, orienter.inward(p, unitNormal(t)), area / static_cast<double>(count)};
  });
  return sites;
}

bool sameSide(const ShellSite& a, const ShellSite& b) { return a.inward_M.dot(b.inward_M) >= 0.0; }

/// Keeps sites at least `apart` from every earlier one on the same side, and gives each the area about it.
std::vector<ShellSite> thinOut(const std::vector<ShellSite>& sites, double apart) {
  std::vector<ShellSite> kept;
  PointGrid grid(apart);
  for (const ShellSite& site : sites) {
    const bool free = grid.visitNear(site.p_MP, [&](std::uint32_t other, double squared) {
      return squared >= apart * apart || !sameSide(kept[other], site);
    });
    if (!free) continue;
    grid.add(site.p_MP, static_cast<std::uint32_t>(kept.size()));
    kept.push_back(site);
    kept.back().area = 0.0;
  }
  for (const ShellSite& site : sites) {
    if (site.area == 0.0) continue;
    double nearest = std::numeric_limits<double>::infinity();
    std::uint32_t owner = 0;
    grid.visitNear(site.p_MP, [&](std::uint32_t other, double squared) {
      if (squared < nearest && sameSide(kept[other], site)) {
        nearest = squared;
        owner = other;
      }
      return true;
    });
    kept[owner].area += site.area;
  }
  return kept;
}

}  // namespace

Pointshell bakeShell(const WeldedMesh& mesh, std::span<const Triangle> surface, const DistanceField& field,
                     const BakeOptions& options, ParallelWork& work) {
  if (surface.empty()) return {};
  const double area = std::accumulate(surface.begin(), surface.end(), 0.0,
                                      [](double sum, const Triangle& t) { return sum + areaOf(t); });
  const double wanted = options.point_spacing > 0.0 ? area / (options.point_spacing * options.point_spacing)
                                                    : static_cast<double>(options.points);
  const double spacing = std::sqrt(area / std::max(wanted, 1.0));
  const double apart = spacing * std::sqrt(kDiscsPerArea);
  const auto candidates = static_cast<std::size_t>(std::ceil(wanted)) * kCandidatesPerPoint;

  const Orienter orienter(field);
  std::vector<ShellSite> sites = edgeSites(mesh, orienter, apart);
  const auto faces = faceSites(surface, area, std::min(candidates, kMaxCandidates), orienter, work);
  sites.insert(sites.end(), faces.begin(), faces.end());
  return buildShell(thinOut(sites, apart), apart);
}

}  // namespace tenon
