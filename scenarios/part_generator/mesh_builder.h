#pragma once

#include <span>
#include <vector>

#include "scenarios/part_generator/mesh.h"

namespace tenon::part_generator {

using Vector2 = Eigen::Vector2d;
/// A closed outline in a plane [m], counter-clockwise; the first point is not repeated.
using Polygon = std::vector<Vector2>;

/// [m^2] Positive for a counter-clockwise outline.
[[nodiscard]] double signedArea(const Polygon& outline);
/// A circle of `radius` [m] as a polygon of `segments` corners, counter-clockwise.
[[nodiscard]] Polygon circle(const Vector2& centre, double radius, int segments);
/// A rectangle with corners rounded by `radius` [m], each in `corner_segments` segments.
[[nodiscard]] Polygon roundedRectangle(const Vector2& centre, const Vector2& size, double radius,
                                       int corner_segments);

/// Triangulates a polygon with holes by ear clipping. The indices count the corners of `outer`, then those of
/// the holes in their order. Stops early when no ear is left (an outline that intersects itself).
[[nodiscard]] std::vector<std::array<int, 3>> triangulate(const Polygon& outer,
                                                          std::span<const Polygon> holes);

/// Builds meshes as a CAD system exports them: every call adds one shell, shells overlap instead of being
/// united, sheets may be open. Lengths in metres, in the frame F set by `at` (M until then).
///
/// Nothing here is random, and no libm function is used whose last digit depends on the platform, so a part
/// has the same bytes wherever it is made.
class MeshBuilder {
 public:
  /// `detail` [-], 0 to 1, decides how finely curved surfaces are tessellated; flat ones are always exact.
  explicit MeshBuilder(double detail) : detail_(detail) {}

  /// Sets the frame F of the following shells.
  MeshBuilder& at(const Pose& X_MF) {
    X_MF_ = X_MF;
    return *this;
  }
  /// Sets the colour of the following shells.
  MeshBuilder& paint(Color color) {
    color_ = color;
    return *this;
  }
  [[nodiscard]] double detail() const { return detail_; }
  [[nodiscard]] const Pose& frame() const { return X_MF_; }
  /// Number of segments of a full circle of `radius` [m] at this detail, a multiple of 4.
  [[nodiscard]] int segments(double radius) const;
  /// A count that grows linearly with the detail from `coarse` to `fine`.
  [[nodiscard]] int steps(int coarse, int fine) const;

  void box(const Vector3& low, const Vector3& high);
  /// A box with edges and corners rounded by `radius` [m].
  void roundBox(const Vector3& low, const Vector3& high, double radius);
  /// A box whose end at low.z has a `chamfer` [m] of 45 degrees all round, so that it enters a pocket.
  void chamferedTongue(const Vector3& low, const Vector3& high, double chamfer);

  /// A solid cylinder of `radius` [m], both ends with a `chamfer` [m].
  void cylinder(const Vector3& from, const Vector3& to, double radius, double chamfer = 0.0);
  /// A truncated cone with end radii `radius_from` [m] and `radius_to` [m].
  void cone(const Vector3& from, const Vector3& to, double radius_from, double radius_to);
  /// A piece of pipe with a bore: radii `outer` [m] and `inner` [m].
  void tube(const Vector3& from, const Vector3& to, double outer, double inner);
  /// A sphere of `radius` [m].
  void sphere(const Vector3& centre, double radius);
  /// A torus of centreline radius `ring` [m] and section radius `radius` [m].
  void torus(const Vector3& centre, const Vector3& axis, double ring, double radius);
  /// Revolves a profile of (radius, height) about `axis`, heights from `foot`. `closed`: ends with a radius
  /// above 0 are capped, unless the profile ends where it begins.
  void lathe(const Vector3& foot, const Vector3& axis, std::span<const Vector2> profile, bool closed = true);

  /// A round bar of `radius` [m] along a polyline whose corners are arcs of radius `bend` [m] or less, as
  /// fits.
  void pipe(std::span<const Vector3> path, double radius, double bend);
  /// A ribbed hose along a path as in pipe(), of outer `radius` [m] and `bend` [m]; `pitch` [m] between ribs
  /// of height `rib` [m].
  void hose(std::span<const Vector3> path, double radius, double bend, double pitch, double rib);
  /// A coil spring along +z from `foot`: `height` [m], `coil_radius` [m] of the centreline, `wire_radius`
  /// [m].
  void spring(const Vector3& foot, double height, double coil_radius, double wire_radius, int turns);

  /// An outline with holes, extruded from `z_low` [m] to `z_high` [m]: plates, ribs, brackets. The outline
  /// may have either orientation, its holes are counter-clockwise.
  void prism(const Polygon& outline, std::span<const Polygon> holes, double z_low, double z_high);
  /// A patch of surface p(u, v), u and v from 0 to 1, of along_u times along_v quads: an open sheet without
  /// thickness.
  template <typename Surface>
  void sheet(int along_u, int along_v, const Surface& surface) {
    beginShell(false);
    for (int i = 0; i < along_u; ++i) {
      for (int j = 0; j < along_v; ++j) {
        const double u0 = static_cast<double>(i) / along_u;
        const double u1 = static_cast<double>(i + 1) / along_u;
        const double v0 = static_cast<double>(j) / along_v;
        const double v1 = static_cast<double>(j + 1) / along_v;
        quad(surface(u0, v0), surface(u1, v0), surface(u1, v1), surface(u0, v1));
      }
    }
    endShell();
  }

  /// Moves the mesh out; the builder is not used afterwards.
  [[nodiscard]] PartMesh take() { return std::move(mesh_); }
  [[nodiscard]] const PartMesh& mesh() const { return mesh_; }

 private:
  using Ring = std::vector<Vector3>;

  void beginShell(bool closed);
  void endShell();
  void triangle(const Vector3& a, const Vector3& b, const Vector3& c);
  void quad(const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d);
  void connect(const Ring& lower, const Ring& upper);
  void fan(const Ring& ring, bool up);
  void sweep(std::span<const Ring> rings, bool capped, bool loop);

  double detail_;  ///< [-] 0 to 1
  Pose X_MF_;
  Color color_ = 0x9AA3AB;
  PartMesh mesh_;
};

/// Cosine and sine of `angle` [rad], with the same bits on every machine.
[[nodiscard]] Vector2 direction(double angle);

/// The rotation that takes +z to `axis` (unit): the shortest one, about x for -z.
[[nodiscard]] Quaternion zTo(const Vector3& axis);

inline constexpr double kPi = 3.141592653589793;  ///< [rad]

}  // namespace tenon::part_generator
