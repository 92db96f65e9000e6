#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/bake/point_block.h"
#include "server/structures/triangle.h"

namespace tenon::bake {

/// A bounding-box hierarchy of a triangle soup for nearest distances while baking: four children per node,
/// whose boxes are tested at once with SIMD.
///
/// Boxes are floats relative to the soup's centre, rounded outwards, and are used for pruning only; distances
/// are those of `squaredDistance` in double. So results are the exact minimum in any order of traversal.
///
/// Threads: constant after construction; a Search belongs to one thread.
class TriangleTree {
 public:
  class Search;

  /// Triangles with an edge longer than `longest` [m] get several boxes.
  TriangleTree(std::span<const structures::Triangle> triangles, double longest);

  /// Calls visit(triangle) for each triangle nearer to p than `radius` [m], for long ones more than once,
  /// until it returns true. Returns whether it did.
  template <typename Visit>
  bool visitWithin(const Vector3& p, double radius, Visit&& visit) const {
    if (nodes_.empty()) return false;
    const Vector3f p_local = local(p);
    const double squared = radius * radius;
    std::array<std::uint32_t, 128> stack;  // three for each level of the tree, which has at most 16
    std::size_t count = 0;
    stack[count++] = 0;
    while (count > 0) {
      const Node& node = nodes_[stack[--count]];
      const Lanes away = node.squaredDistances(p_local) * (1.0F - kRounding);
      for (std::size_t lane = 0; lane < 4; ++lane) {
        const std::uint32_t child = node.child[lane];
        if (!(away[static_cast<Eigen::Index>(lane)] < squared) || child == kNothing) continue;
        if ((child & kTriangle) == 0) {
          stack[count++] = child;
        } else if (const structures::Triangle& triangle = triangles_[child - kTriangle];
                   structures::squaredDistance(p, triangle) < squared && visit(triangle)) {
          return true;
        }
      }
    }
    return false;
  }

  /// The triangles nearer to p than `radius` [m], in the order of the soup.
  [[nodiscard]] std::vector<std::uint32_t> within(const Vector3& p, double radius) const;

  /// Whether a triangle is nearer to p than `radius` [m].
  [[nodiscard]] bool anyWithin(const Vector3& p, double radius) const {
    return visitWithin(p, radius, [](const structures::Triangle&) { return true; });
  }

  /// False only if no triangle is nearer than `radius` [m] to the cube around `centre` [m] with `half_edge`
  /// [m].
  [[nodiscard]] bool maybeNear(const Vector3& centre, double half_edge, double radius) const;

  /// Whether a ray from p intersects an odd number of triangles. No component of `direction` may be 0.
  [[nodiscard]] bool oddCrossings(const Vector3& p, const Vector3& direction) const;

  /// The triangles that a ray from p intersects, in the order of the soup. No component of `direction` may
  /// be 0.
  [[nodiscard]] std::vector<std::uint32_t> crossed(const Vector3& p, const Vector3& direction) const;

  /// The normal of a triangle, of any length.
  [[nodiscard]] Vector3 normalOf(std::uint32_t triangle) const {
    const structures::Triangle& t = triangles_[triangle];
    return (t[1] - t[0]).cross(t[2] - t[0]);
  }

  /// Where a segment meets the soup first.
  struct Intersection {
    double fraction = 1.0;                           ///< [-] of the segment
    const structures::Triangle* triangle = nullptr;  ///< null: nowhere
  };
  /// Of the segment from p to p + along.
  [[nodiscard]] Intersection firstIntersection(const Vector3& p, const Vector3& along) const;

 private:
  using Lanes = Eigen::Array<float, 4, 1>;
  /// [-] Relative rounding error of the float arithmetic with boxes, with a margin.
  static constexpr float kRounding = 1e-5F;
  struct Node {
    std::array<Lanes, 3> low, high;      // of unused lanes: the largest float
    std::array<std::uint32_t, 4> child;  // a node, kTriangle + a triangle, or kNothing
    /// [m^2] From the boxes to the cube around p with `half_edge` [m].
    [[nodiscard]] EIGEN_ALWAYS_INLINE Lanes squaredDistances(const Vector3f& p,
                                                             float half_edge = 0.0F) const {
      const Lanes x = ((low[0] - p.x()).max(p.x() - high[0]) - half_edge).max(0.0F);
      const Lanes y = ((low[1] - p.y()).max(p.y() - high[1]) - half_edge).max(0.0F);
      const Lanes z = ((low[2] - p.z()).max(p.z() - high[2]) - half_edge).max(0.0F);
      return x * x + y * y + z * z;
    }
    /// For each lane whether a ray intersects its box, up to the multiple `end` [-] of its direction.
    [[nodiscard]] EIGEN_ALWAYS_INLINE std::array<bool, 4> intersectedBy(const Vector3f& p,
                                                                        const Vector3f& inverse_direction,
                                                                        float end) const {
      Lanes enter = Lanes::Zero();
      Lanes leave = Lanes::Constant(end);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const float c = p[static_cast<Eigen::Index>(axis)];
        const float inverse = inverse_direction[static_cast<Eigen::Index>(axis)];
        const Lanes a = (low[axis] - c) * inverse;
        const Lanes b = (high[axis] - c) * inverse;
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
      }
      std::array<bool, 4> met;
      for (std::size_t lane = 0; lane < 4; ++lane) {
        const auto i = static_cast<Eigen::Index>(lane);
        met[lane] = leave[i] * (1.0F + kRounding) >= enter[i];
      }
      return met;
    }
    /// Copies a lane of another node.
    void take(std::size_t lane, const Node& from, std::size_t source);
  };
  [[nodiscard]] static Node emptyNode();
  static constexpr std::uint32_t kTriangle = 0x80000000U;
  static constexpr std::uint32_t kNothing = 0xFFFFFFFFU;

  struct Builder;
  [[nodiscard]] Vector3f local(const Vector3& p) const { return (p - centre_).cast<float>(); }

  Vector3 centre_ = Vector3::Zero();
  float slack_ = 0.0F;  // [m] rounding error of a point in float
  std::vector<structures::Triangle> triangles_;
  std::vector<Node> nodes_;
};

/// Nearest distances of many points in one small ball: subtrees beyond its reach are pruned once, and blocks
/// of points share a list of the few triangles that can be nearest to one of them.
class TriangleTree::Search {
 public:
  /// For points within `radius` [m] of `centre`, and triangles within `reach` [m] of them.
  Search(const TriangleTree& tree, const Vector3& centre, double radius, double reach);

  /// Lists the triangles for points within `radius` [m] of `centre` that ask up to `reach` [m], both within
  /// what the constructor was given. False: none.
  bool focus(const Vector3& centre, double radius, double reach);

  /// Lowers the squared distances of points in the focus to those of the nearest triangles.
  void lower(PointBlock& block);

 private:
  struct Candidate {
    double distance;  // [m] from the centre of the focus to the whole triangle
    std::uint32_t triangle;
  };
  /// Lowers `squared` [m^2] to the squared distance of the nearest triangle in the subtree.
  void visit(const Node& node, const Vector3& p, const Vector3f& p_local, double& squared);
  /// Lists the triangles of the subtree nearer than `far` [m], which is lowered to the least distance
  /// plus `spread` [m].
  void collect(const Node& node, const Vector3& p, const Vector3f& p_local, double spread, double& far);

  const TriangleTree& tree_;
  std::vector<Node> roots_;
  std::uint32_t nearest_ = kNothing;  // to the centre of the last focus, or found last
  double wide_ = 0.0;                 // [m] radius of the focus, with a margin for rounding
  bool listed_ = false;
  std::vector<Candidate> candidates_;
};

}  // namespace tenon::bake
