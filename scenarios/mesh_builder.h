#pragma once

#include <span>
#include <vector>

#include "scenarios/mesh.h"

namespace tenon {

using Vector2 = Eigen::Vector2d;
/// A closed outline in a plane, counter-clockwise, without the first point repeated.
using Polygon = std::vector<Vector2>;

/// Positive for a counter-clockwise outline.
[[nodiscard]] double signedArea(const Polygon& outline);
/// A circle as a polygon of `segments` corners, counter-clockwise.
[[nodiscard]] Polygon circle(const Vector2& centre, double radius, int segments);
/// A rectangle with its corners rounded.
[[nodiscard]] Polygon roundedRectangle(const Vector2& centre, const Vector2& size, double radius,
                                       int corner_segments);

/// Cuts a polygon with holes into triangles by ear clipping; corners of outer and holes, in that order, are
/// what the indices count.
[[nodiscard]] std::vector<std::array<int, 3>> triangulate(const Polygon& outer,
                                                          std::span<const Polygon> holes);

/// Builds meshes as a CAD system exports them: every call adds one shell of its own, shells overlap instead
/// of being united, sheets may be open. Lengths in metres, seen in the frame set by `at` (W until then).
///
/// Nothing here is random and no libm function with a platform's own last digit is used, so a part has the
/// same bytes wherever it is made.
class MeshBuilder {
 public:
  /// `detail` 0..1 chooses how finely round things are cut; flat things stay exact at any detail.
  explicit MeshBuilder(double detail) : detail_(detail) {}

  MeshBuilder& at(const Pose& X_MF) {
    X_MF_ = X_MF;
    return *this;
  }
  MeshBuilder& paint(Color color) {
    color_ = color;
    return *this;
  }
  [[nodiscard]] double detail() const { return detail_; }
  [[nodiscard]] const Pose& frame() const { return X_MF_; }
  /// Corners of a full circle of this radius at this detail, a multiple of 4.
  [[nodiscard]] int segments(double radius) const;
  /// A count that grows with detail from `coarse` to `fine`.
  [[nodiscard]] int steps(int coarse, int fine) const;

  void box(const Vector3& low, const Vector3& high);
  /// A box whose edges and corners are rounded.
  void roundBox(const Vector3& low, const Vector3& high, double radius);
  /// A box whose foot (at low.z) is chamfered all round at 45 degrees: what finds its way into a pocket.
  void chamferedTongue(const Vector3& low, const Vector3& high, double chamfer);

  void cylinder(const Vector3& from, const Vector3& to, double radius, double chamfer = 0.0);
  void cone(const Vector3& from, const Vector3& to, double radius_from, double radius_to);
  /// A thick-walled pipe piece, open through.
  void tube(const Vector3& from, const Vector3& to, double outer, double inner);
  void sphere(const Vector3& centre, double radius);
  void torus(const Vector3& centre, const Vector3& axis, double ring, double radius);
  /// Turns a profile of (radius, height) about `axis` from `foot`; radii of 0 close it.
  void lathe(const Vector3& foot, const Vector3& axis, std::span<const Vector2> profile, bool closed = true);

  /// A round bar along a polyline whose corners are bent with `bend` radius.
  void pipe(std::span<const Vector3> path, double radius, double bend);
  /// A ribbed hose, `pitch` between ribs of height `rib`.
  void hose(std::span<const Vector3> path, double radius, double bend, double pitch, double rib);
  /// A coil spring about z from z_low to z_high.
  void spring(const Vector3& foot, double height, double coil_radius, double wire_radius, int turns);

  /// An outline with holes, extruded from z_low to z_high: plates, ribs, brackets. The outline may run
  /// either way round, its holes counter-clockwise.
  void prism(const Polygon& outline, std::span<const Polygon> holes, double z_low, double z_high);
  /// A patch of surface p(u, v), u and v in 0..1: an open sheet without thickness.
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

  double detail_;
  Pose X_MF_;
  Color color_ = 0x9AA3AB;
  PartMesh mesh_;
};

/// The cosine and sine of an angle, the same bits on every machine.
[[nodiscard]] Vector2 direction(double angle);

/// The rotation that takes +z to `axis` (unit).
[[nodiscard]] Quaternion zTo(const Vector3& axis);

inline constexpr double kPi = 3.141592653589793;

}  // namespace tenon
