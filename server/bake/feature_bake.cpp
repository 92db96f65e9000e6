#include "server/bake/feature_bake.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "server/bake/face_sides.h"
#include "server/bake/normal_estimator.h"
#include "server/bake/wedge_reach.h"
#include "server/structures/point_grid.h"
#include "server/structures/shell_builder.h"

namespace tenon::bake {
namespace {

using Edge = WeldedMesh::Edge;
using structures::FeatureEdge;
using structures::SurfaceSample;

constexpr double kTanHalfFlat =
    0.026182;  // [-] faces that turn by less (3 deg) are facets of a round surface
constexpr double kPlaneCosine = -0.999986;  // [-] the flattest (179.7 deg) are facets of a plane
constexpr double kTanHalf60 = 0.577;        // [-] of a facet of a round surface at most
constexpr double kTanHalf40 = 0.364;  // [-] tan of half the turn from which an edge is sharp at any radius
constexpr double kCos6 = 0.995;       // [-] a polyline that turns less at a vertex is straight there
constexpr double kCos30 = 0.866;      // [-] a polyline that turns by more at a vertex has a corner there
constexpr double kEndless = 1.0;      // [m] from any end of an edge
constexpr double kCos20 = 0.94;       // [-] faces of edges that are merged turn by less

constexpr double kCos40 = 0.766;  // [-] of the turn from which an edge is sharp at any radius
constexpr double kNarrow = 25.0;  // [-] facets are narrow up to so many times what counts as straight
constexpr int kMaxNarrow = 8;     // facets in a row

constexpr double kMaxSkew = 3.0;    // [-] of the plane in which an edge ends: 72 degrees
constexpr double kFlatSkew = 1e-3;  // [-] less is rounding
constexpr double kStraight = 0.02;  // [voxels] by which a vertex may be off a line

/// [-] Of the widths of two faces, from which on they are no equal facets of one surface.
constexpr double kChamfer = 3.0;

/// [voxels] From an edge: beyond them the interpolated distance of a wedge is exact.
constexpr double kLargestReach = 2.0;

/// [m] Features are sampled for a pointshell of the other part with about this spacing at most, and at least.
constexpr double kLargestSpacing = 0.004;
constexpr double kSmallestSpacing = 0.002;

/// A convex edge of the mesh. `into` as in FeatureEdge.
struct ConvexEdge {
  std::uint32_t from = 0, to = 0;
  std::array<Vector3, 2> into_M;
  double tan_half_turn = 0.0;  // [-] of the angle by which the faces turn
  double radius = 0.0;         // [m] of the round surface of which its faces are facets
};

/// Lengths that follow from the spacing of the points, all [m].
struct Sizes {
  explicit Sizes(double spacing)
      : apart(std::clamp(spacing, kSmallestSpacing, kLargestSpacing)),
        piece(1.5 * apart),
        straight(apart / 80.0),
        sharp_radius(apart / 8.0),
        largest_radius(2.0 * apart) {}

  double apart;           ///< of the other part's points, about
  double piece;           ///< longest piece of an edge
  double straight;        ///< by which a vertex may be off a line at most
  double sharp_radius;    ///< rounder edges are sampled as surfaces, without their edges
  double largest_radius;  ///< rounder surfaces are no features; of facets, on a ball of equal ones 1.5 radii

  /// Spacing of points on a surface of this radius: a flat face enters between two by apart / 16 at most, and
  /// no end of a thin stud is passed over.
  [[nodiscard]] double spacingAt(double radius) const {
    return std::clamp(std::min(std::sqrt(0.5 * radius * apart), 0.6 * radius), apart / 16.0, apart);
  }
};

/// A feature in the making.
struct Feature {
  SurfaceSample sample;
  FeatureEdge edge;
};

class FeatureFinder {
 public:
  FeatureFinder(const WeldedMesh& mesh, const TriangleTree& surface, const structures::DistanceField& field,
                const Sizes& sizes)
      : mesh_(mesh),
        field_(field),
        normals_(field),
        sizes_(sizes),
        edges_(mesh.edges()),
        sides_(mesh, edges_, field),
        reach_(surface),
        grid_(sizes.apart) {
    edges_of_.resize(mesh.triangles.size(), {Edge::kNone, Edge::kNone, Edge::kNone});
    for (std::uint32_t i = 0; i < edges_.size(); ++i) {
      for (const std::uint32_t triangle : {edges_[i].first, edges_[i].second}) {
        if (triangle == Edge::kNone) continue;
        auto& of = edges_of_[triangle];
        *std::find(of.begin(), of.end() - 1, Edge::kNone) = i;
      }
    }
    for (std::uint32_t i = 0; i < edges_.size(); ++i) addIfConvex(i);
  }

  std::vector<Feature> find() {
    addChains();
    addRoundPoints();
    return std::move(features_);
  }

 private:
  [[nodiscard]] const Vector3& at(std::uint32_t vertex) const { return mesh_.positions[vertex]; }

  /// [m] Vertices nearer to a line, and faces to a plane, are on it: a fit may be as narrow as a voxel.
  [[nodiscard]] double straightAt(const Vector3& p) const {
    return std::min(sizes_.straight, kStraight * field_.voxelAt(p));
  }

  /// A face beside an edge.
  struct Side {
    std::uint32_t triangle = Edge::kNone;
    double width = 0.0;  // [m] height over the edge
  };

  [[nodiscard]] Side sideOf(const Edge& edge, std::uint32_t triangle) const {
    const Vector3 along = (at(edge.to) - at(edge.from)).normalized();
    const structures::Triangle& t = mesh_.triangles[triangle];
    const Vector3 to = t[0] + t[1] + t[2] - 2.0 * at(edge.from) - at(edge.to);
    return {triangle, (to - along * along.dot(to)).norm()};
  }

  /// From a face beside an edge on, away from it: the first one that is not narrow. Without a triangle where
  /// there is none.
  [[nodiscard]] Side wideSide(std::uint32_t edge, Side side, double narrow) const {
    for (int k = 0; k < kMaxNarrow && side.width < narrow; ++k) {
      // a narrow triangle has two long edges
      std::uint32_t next = Edge::kNone;
      double longest = 0.0;
      for (const std::uint32_t other : edges_of_[side.triangle]) {
        if (other == edge || other == Edge::kNone) continue;
        const double length = (at(edges_[other].to) - at(edges_[other].from)).norm();
        if (length > longest) next = other;
        longest = std::max(longest, length);
      }
      if (next == Edge::kNone || edges_[next].second == Edge::kNone) return {};
      const Edge& beyond = edges_[next];
      side = sideOf(beyond, beyond.first == side.triangle ? beyond.second : beyond.first);
      edge = next;
    }
    return side.width < narrow ? Side{} : side;
  }

  /// Of an edge that is not sharp and has a narrow face, the turn and the radius are those of the wide faces
  /// to both sides: between vertices that are rounded, the direction of a narrow one is arbitrary.
  void measureBeyondNarrow(std::uint32_t index, const std::array<Side, 2>& faces, ConvexEdge& convex) const {
    const double width = std::min(faces[0].width, faces[1].width);
    const double tolerance = straightAt(at(convex.from));
    if (convex.tan_half_turn >= kTanHalf40 || width >= kNarrow * tolerance ||
        2.0 * convex.tan_half_turn * width >= tolerance)
      return;
    const std::array<Side, 2> wide{wideSide(index, faces[0], kNarrow * tolerance),
                                   wideSide(index, faces[1], kNarrow * tolerance)};
    if (wide[0].triangle == Edge::kNone || wide[1].triangle == Edge::kNone) return;
    const double flat = sides_.outward(wide[0].triangle).dot(sides_.outward(wide[1].triangle));
    if (flat < kCos40) return;
    convex.tan_half_turn = std::sqrt(std::max(1.0 - flat, 0.0) / (1.0 + flat));
    convex.radius = 0.5 * std::min(wide[0].width, wide[1].width) / std::max(convex.tan_half_turn, 1e-9);
  }

  /// Sorts an edge into the sharp or the round ones when it is convex.
  void addIfConvex(std::uint32_t index) {
    const Edge& edge = edges_[index];
    const bool open = edge.second == Edge::kNone;
    const Vector3 along = (at(edge.to) - at(edge.from)).normalized();
    ConvexEdge convex{edge.from, edge.to, {}, 1.0, 0.0};
    std::array<double, 2> widths{};
    for (const std::size_t face : {0U, 1U}) {
      const structures::Triangle& t = mesh_.triangles[face == 0 || open ? edge.first : edge.second];
      const Vector3 to = t[0] + t[1] + t[2] - 2.0 * at(edge.from) - at(edge.to);
      const Vector3 towards = to - along * along.dot(to);
      const double height = towards.norm();
      // far from the mesh's origin the height of a thin triangle may be cancelled
      if (!(height > 0.0)) return;
      widths[face] = height;
      convex.into_M[face] = towards / height;
    }
    const auto [width, widest] = std::minmax(widths[0], widths[1]);
    if (!open) {
      const double flat = convex.into_M[0].dot(convex.into_M[1]);
      if (flat < kPlaneCosine) return;
      const Vector3 outward = sides_.outward(edge.first);
      if (outward.dot(convex.into_M[1]) > 0.0) return;
      convex.tan_half_turn = std::sqrt((1.0 + flat) / std::max(1.0 - flat, 1e-12));
      convex.radius = 0.5 * width / convex.tan_half_turn;
      measureBeyondNarrow(index, {Side{edge.first, widths[0]}, Side{edge.second, widths[1]}}, convex);
      if (convex.tan_half_turn < kTanHalfFlat) {
        if (convex.radius <= sizes_.largest_radius) round_.push_back(convex);
        return;
      }
    }
    const bool sharp = convex.tan_half_turn >= kTanHalf40 || convex.radius <= sizes_.sharp_radius;
    // points of the other part see a long ridge of a tube that is wider than half their distance; the faces
    // beside a chamfer are wider than it
    const bool is_ridge = !(sharp && widest > kChamfer * width) && convex.radius > 0.5 * sizes_.apart &&
                          convex.radius <= sizes_.largest_radius && convex.tan_half_turn < kTanHalf60 &&
                          (at(edge.to) - at(edge.from)).norm() > 3.0 * sizes_.apart;
    if (is_ridge) return;
    if (!sharp && convex.radius > sizes_.largest_radius) return;
    (sharp ? sharp_ : round_).push_back(convex);
  }

  void add(const Vector3& p, const Vector3& into, const FeatureEdge& edge = {}) {
    if (!normals_.onSurface(p)) return;
    features_.push_back({{p, normals_.inward(p, into), 0.0}, edge});
    grid_.add(p, static_cast<std::uint32_t>(features_.size() - 1));
  }

  /// Follows sharp edges from vertex to vertex, and cuts them into pieces.
  void addChains() {
    std::vector<std::vector<std::uint32_t>> at_vertex(mesh_.positions.size());
    for (std::uint32_t i = 0; i < sharp_.size(); ++i) {
      at_vertex[sharp_[i].from].push_back(i);
      at_vertex[sharp_[i].to].push_back(i);
    }
    faces_at_.clear();
    for (std::uint32_t i = 0; i < mesh_.corners.size(); ++i) {
      for (const std::uint32_t vertex : mesh_.corners[i]) {
        const std::size_t edges = at_vertex[vertex].size();
        if (edges > 0 && edges != 2) faces_at_[vertex].push_back(i);
      }
    }
    std::vector<bool> done(sharp_.size(), false);
    const auto follow = [&](std::uint32_t vertex, std::uint32_t edge) {
      std::vector<std::uint32_t> chain{vertex};
      std::vector<std::uint32_t> edges;
      while (!done[edge]) {
        done[edge] = true;
        edges.push_back(edge);
        vertex = sharp_[edge].from == vertex ? sharp_[edge].to : sharp_[edge].from;
        chain.push_back(vertex);
        if (at_vertex[vertex].size() != 2) break;
        edge = at_vertex[vertex][at_vertex[vertex][0] == edge ? 1 : 0];
      }
      addChain(chain, edges);
    };
    for (std::uint32_t vertex = 0; vertex < at_vertex.size(); ++vertex) {
      if (at_vertex[vertex].empty() || at_vertex[vertex].size() == 2) continue;
      addCorner(vertex, at_vertex[vertex]);
      for (const std::uint32_t edge : at_vertex[vertex])
        if (!done[edge]) follow(vertex, edge);
    }
    for (std::uint32_t edge = 0; edge < sharp_.size(); ++edge)
      if (!done[edge]) follow(sharp_[edge].from, edge);
  }

  /// A vertex where sharp edges end or meet.
  void addCorner(std::uint32_t vertex, const std::vector<std::uint32_t>& edges) {
    Vector3 into = Vector3::Zero();
    for (const std::uint32_t edge : edges) into += sharp_[edge].into_M[0] + sharp_[edge].into_M[1];
    if (into.norm() > 1e-6) add(at(vertex), into.normalized());
  }

  /// Whether the vertices of the chain between i and j are on the segment of these two, and the faces of the
  /// edges turn little.
  [[nodiscard]] bool isStraight(const std::vector<std::uint32_t>& chain,
                                const std::vector<std::uint32_t>& edges, std::size_t i, std::size_t j) const {
    const Vector3 a = at(chain[i]);
    const Vector3 along = (at(chain[j]) - a).normalized();
    double reached = 0.0;
    for (std::size_t k = i + 1; k < j; ++k) {
      const Vector3 to = at(chain[k]) - a;
      if ((to - along * along.dot(to)).norm() > straightAt(a) || along.dot(to) < reached) return false;
      reached = along.dot(to);
    }
    const auto& first = sharp_[edges[i]].into_M;
    const auto& last = sharp_[edges[j - 1]].into_M;
    return std::max(std::min(first[0].dot(last[0]), first[1].dot(last[1])),
                    std::min(first[0].dot(last[1]), first[1].dot(last[0]))) > kCos20;
  }

  /// Edges of a chain on one line.
  struct Segment {
    Vector3 from, along;                 // [m] start, unit direction
    double length = 0.0;                 // [m]
    std::array<Vector3, 2> into;         // as FeatureEdge
    double turn = -1.0;                  // [-] cosine of the angle to the segment before; -1: there is none
    std::array<double, 2> beyond{0, 0};  // [m] to the next corner, before and behind
    // [-] of the planes in which it ends, before and behind, see skewOf
    std::array<Vector3, 2> skew{Vector3::Zero(), Vector3::Zero()};
  };

  /// [-] Of a plane in which an edge ends, with its normal: a point at r from the edge is at the end where it
  /// is skew . r before the end of the edge. `out`: unit vector along the edge. Zero where the plane is too
  /// oblique.
  [[nodiscard]] static Vector3 skewOf(const Vector3& out, const Vector3& normal) {
    const double slope = normal.dot(out);
    const Vector3 across = normal - slope * out;
    if (across.norm() >= kMaxSkew * std::abs(slope)) return Vector3::Zero();
    return across / slope;
  }

  /// Whether an edge continues beyond a segment: it is no corner where it turns little, or around the outside
  /// of a solid, as the rim of a hole does.
  [[nodiscard]] static bool isContinued(const Segment& before, const Segment& behind) {
    const double first = before.skew[1].dot(before.into[0]);
    const double second = before.skew[1].dot(before.into[1]);
    return behind.turn > kCos30 || (std::max(first, second) < kFlatSkew && first + second < -kFlatSkew);
  }

  /// The skew of the plane of the face at a corner where an edge ends. `out` as in skewOf(). Zero where
  /// there is not one plane beside those of the edge itself.
  [[nodiscard]] Vector3 skewAtCorner(std::uint32_t vertex, const Vector3& out,
                                     const std::array<Vector3, 2>& into) const {
    const auto faces = faces_at_.find(vertex);
    if (faces == faces_at_.end()) return Vector3::Zero();
    const std::array<Vector3, 2> sides{out.cross(into[0]), out.cross(into[1])};
    Vector3 found = Vector3::Zero();
    for (const std::uint32_t face : faces->second) {
      const auto& [a, b, c] = mesh_.triangles[face];
      Vector3 normal = (b - a).cross(c - a).normalized();
      if (normal.isZero(0.0)) continue;
      if (std::abs(normal.dot(sides[0])) > kCos6 || std::abs(normal.dot(sides[1])) > kCos6) continue;
      if (normal.dot(out) < 0.0) normal = -normal;
      if (!found.isZero() && normal.dot(found) < kCos6) return Vector3::Zero();
      if (found.isZero()) found = normal;
    }
    return found.isZero() ? found : skewOf(out, found);
  }

  /// Merges edges of one line.
  [[nodiscard]] std::vector<Segment> segmentsOf(const std::vector<std::uint32_t>& chain,
                                                const std::vector<std::uint32_t>& edges) const {
    std::vector<Segment> segments;
    for (std::size_t i = 0; i + 1 < chain.size();) {
      std::size_t j = i + 1;
      while (j + 1 < chain.size() && isStraight(chain, edges, i, j + 1)) ++j;
      const Vector3 to = at(chain[j]) - at(chain[i]);
      segments.push_back(
          {at(chain[i]), to.normalized(), to.norm(), perpendicular(sharp_[edges[(i + j) / 2]].into_M, to)});
      i = j;
    }
    const std::size_t count = segments.size();
    const bool closed = chain.front() == chain.back();
    for (std::size_t i = closed ? 0 : 1; i < count; ++i) {
      Segment& before = segments[(i + count - 1) % count];
      Segment& behind = segments[i];
      behind.turn = before.along.dot(behind.along);
      // the plane that halves the angle
      before.skew[1] = skewOf(before.along, before.along + behind.along);
      behind.skew[0] = skewOf(-behind.along, -before.along - behind.along);
    }
    if (!closed) {
      segments.front().skew[0] = skewAtCorner(chain.front(), -segments.front().along, segments.front().into);
      segments.back().skew[1] = skewAtCorner(chain.back(), segments.back().along, segments.back().into);
    }
    // a ring without a corner has no end
    const bool is_ring = closed && isContinued(segments.back(), segments.front());
    segments.front().beyond[0] = segments.back().beyond[1] = is_ring ? kEndless : 0.0;
    for (std::size_t i = 1; i < count; ++i) {
      const std::size_t k = count - 1 - i;
      const Segment& before = segments[i - 1];
      const Segment& behind = segments[k + 1];
      segments[i].beyond[0] = isContinued(before, segments[i]) ? before.beyond[0] + before.length : 0.0;
      segments[k].beyond[1] = isContinued(segments[k], behind) ? behind.beyond[1] + behind.length : 0.0;
    }
    return segments;
  }

  /// Cuts the lines of a chain into pieces, and adds the vertices where it turns.
  void addChain(const std::vector<std::uint32_t>& chain, const std::vector<std::uint32_t>& edges) {
    for (const Segment& segment : segmentsOf(chain, edges)) {
      const Vector3 bisector = (segment.into[0] + segment.into[1]).normalized();
      const bool turns = segment.turn > -1.0 && segment.turn < kCos6;
      if (turns && segment.length > sizes_.sharp_radius) add(segment.from, bisector);
      const int pieces = std::max(1, static_cast<int>(std::ceil(segment.length / sizes_.piece)));
      const double half = 0.5 * segment.length / pieces;
      for (int k = 0; k < pieces; ++k) {
        const Vector3 centre = segment.from + segment.along * ((2 * k + 1) * half);
        FeatureEdge piece;
        piece.half_M = (half * segment.along).cast<float>();
        piece.into_M = {segment.into[0].cast<float>(), segment.into[1].cast<float>()};
        piece.beyond = {static_cast<float>(segment.beyond[0] + 2 * k * half),
                        static_cast<float>(segment.beyond[1] + 2 * (pieces - 1 - k) * half)};
        setReach({centre,
                  half * segment.along,
                  segment.into,
                  {k == 0 ? segment.skew[0] : Vector3::Zero(),
                   k + 1 == pieces ? segment.skew[1] : Vector3::Zero()}},
                 piece);
        add(centre, bisector, piece);
      }
    }
  }

  /// Between skewed ends, or perpendicular ones where a surface behind the face at a corner is then farther.
  void setReach(WedgePiece wedge, FeatureEdge& piece) const {
    const double most = kLargestReach * field_.voxelAt(wedge.centre);
    const double tolerance = straightAt(wedge.centre);
    double reach = reach_.of(wedge, most, tolerance);
    if (reach < most && !(wedge.skew[0].isZero(0.0) && wedge.skew[1].isZero(0.0))) {
      const std::array<Vector3, 2> skewed = std::exchange(wedge.skew, {Vector3::Zero(), Vector3::Zero()});
      const double between_perpendicular = reach_.of(wedge, most, tolerance);
      if (between_perpendicular <= reach) wedge.skew = skewed;
      reach = std::max(reach, between_perpendicular);
    }
    piece.reach = static_cast<float>(reach);
    piece.skew = {inFaces(wedge.skew[0], wedge.into), inFaces(wedge.skew[1], wedge.into)};
  }

  [[nodiscard]] static std::array<Vector3, 2> perpendicular(const std::array<Vector3, 2>& into,
                                                            const Vector3& along) {
    const Vector3 unit = along.normalized();
    const auto one = [&unit](const Vector3& v) { return Vector3((v - unit * unit.dot(v)).normalized()); };
    return {one(into[0]), one(into[1])};
  }

  /// [-] A vector across an edge as a sum of `into`; zero where these are almost along each other.
  [[nodiscard]] static Eigen::Vector2f inFaces(const Vector3& v, const std::array<Vector3, 2>& into) {
    const double cosine = into[0].dot(into[1]);
    const double sine2 = 1.0 - cosine * cosine;
    if (sine2 < 0.01) return Eigen::Vector2f::Zero();
    const double first = v.dot(into[0]);
    const double second = v.dot(into[1]);
    return (Eigen::Vector2d(first - cosine * second, second - cosine * first) / sine2).cast<float>();
  }

  /// Points on tight round surfaces, along the edges of their facets, the tightest first.
  void addRoundPoints() {
    std::stable_sort(round_.begin(), round_.end(),
                     [](const ConvexEdge& a, const ConvexEdge& b) { return a.radius < b.radius; });
    for (const ConvexEdge& edge : round_) {
      const double apart = sizes_.spacingAt(edge.radius);
      const Vector3 a = at(edge.from);
      const Vector3 b = at(edge.to);
      const Vector3 into = (edge.into_M[0] + edge.into_M[1]).normalized();
      const int steps = std::max(1, static_cast<int>(std::ceil((b - a).norm() / apart)));
      for (int k = 0; k <= steps; ++k) {
        const Vector3 p = a + (b - a) * (static_cast<double>(k) / steps);
        const bool free = grid_.visitNear(p, [&](std::uint32_t other, double squared) {
          return squared >= apart * apart || features_[other].sample.inward_M.dot(into) < 0.0;
        });
        if (free) add(p, into);
      }
    }
  }

  const WeldedMesh& mesh_;
  const structures::DistanceField& field_;
  const NormalEstimator normals_;
  const Sizes sizes_;
  const std::vector<Edge> edges_;
  const FaceSides sides_;
  std::vector<std::array<std::uint32_t, 3>> edges_of_;  // of each triangle, indices
  const WedgeReach reach_;
  std::vector<ConvexEdge> sharp_, round_;
  std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> faces_at_;  // of vertices where chains end
  std::vector<Feature> features_;
  structures::PointGrid grid_;
};

}  // namespace

structures::FeatureShell bakeFeatures(const WeldedMesh& mesh, const TriangleTree& surface,
                                      const structures::DistanceField& field, double spacing) {
  const Sizes sizes(spacing);
  const std::vector<Feature> features = FeatureFinder(mesh, surface, field, sizes).find();
  std::vector<SurfaceSample> samples;
  samples.reserve(features.size());
  for (const Feature& feature : features) samples.push_back(feature.sample);
  std::vector<std::uint32_t> order;
  structures::FeatureStorage storage;
  storage.points = structures::buildFlatShell(samples, sizes.apart, order);
  storage.edges.reserve(order.size());
  for (const std::uint32_t i : order) storage.edges.push_back(features[i].edge);
  return structures::makeFeatureShell(std::move(storage));
}

}  // namespace tenon::bake
