#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/structures/triangle.h"

namespace tenon {

/// Finds the nearest of many triangles: a tree of boxes, four to a node, four of them tested at once.
///
/// Boxes are floats about the soup's centre, rounded outwards, and only say what to skip; distances are those
/// of `squaredDistance`. So an answer is the exact minimum, whatever the order of the search.
///
/// Threads: constant after construction; a Search belongs to one thread.
class TriangleTree {
 public:
  class Search;

  /// Triangles longer than `longest` [m] are found through several boxes.
  TriangleTree(std::span<const Triangle> triangles, double longest);

  /// Whether a triangle is nearer to p than `reach` [m].
  [[nodiscard]] bool anyWithin(const Vector3& p, double reach) const;

  /// Whether a ray from p crosses an odd number of triangles. No component of `direction` may be 0.
  [[nodiscard]] bool oddCrossings(const Vector3& p, const Vector3& direction) const;

 private:
  using Lanes = Eigen::Array<float, 4, 1>;
  struct Node {
    std::array<Lanes, 3> low, high;      // empty lanes are infinitely far away
    std::array<std::uint32_t, 4> child;  // a node, or kTriangle + a triangle
    [[nodiscard]] EIGEN_ALWAYS_INLINE Lanes squaredDistances(const Vector3f& p) const {
      const Lanes x = (low[0] - p.x()).max(p.x() - high[0]).max(0.0F);
      const Lanes y = (low[1] - p.y()).max(p.y() - high[1]).max(0.0F);
      const Lanes z = (low[2] - p.z()).max(p.z() - high[2]).max(0.0F);
      return x * x + y * y + z * z;
    }
    /// Which boxes a ray meets, a lane each.
    [[nodiscard]] std::array<bool, 4> metBy(const Vector3f& p, const Vector3f& inverse_direction) const;
  };
  static constexpr std::uint32_t kTriangle = 0x80000000U;
  static constexpr std::uint32_t kNothing = 0xFFFFFFFFU;

  struct Builder;
  [[nodiscard]] Vector3f local(const Vector3& p) const { return (p - centre_).cast<float>(); }

  Vector3 centre_ = Vector3::Zero();
  float slack_ = 0.0F;  // [m] what rounding to float can move a point
  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
};

/// Asks for many points of one small ball: what is out of its reach is left out once, and each answer is
/// where the next search begins.
class TriangleTree::Search {
 public:
  /// For points within `radius` of `centre`, and triangles within `reach` of them [m].
  Search(const TriangleTree& tree, const Vector3& centre, double radius, double reach);

  /// Squared distance from p to the nearest triangle, or `reach` squared when none is nearer; `reach` may be
  /// shorter than the whole search's.
  [[nodiscard]] double squaredDistance(const Vector3& p, double reach);

 private:
  void visit(const Node& node, const Vector3& p, const Vector3f& p_local, double& squared);

  const TriangleTree& tree_;
  std::vector<Node> roots_;
  std::uint32_t last_ = kNothing;
};

}  // namespace tenon
