#pragma once

#include <span>

#include "scenarios/part_generator/mesh_builder.h"

/// Standard small hardware of machines, each item built from several overlapping shells. Positions and axes
/// are in the builder's current frame.
namespace tenon::part_generator {

/// A hexagon bolt's head with washer and shank, standing on `seat`, head towards `axis` (unit); `size` [m] is
/// the thread's diameter.
void addHexBolt(MeshBuilder& b, const Vector3& seat, const Vector3& axis, double size);
/// `count` bolts of `size` [m], evenly spaced from one seat to another.
void addBoltRow(MeshBuilder& b, const Vector3& first, const Vector3& last, int count, const Vector3& axis,
                double size);
/// A round boss with a blind hole, standing on `foot`: radii `outer` [m] and `inner` [m], `height` [m].
void addBoss(MeshBuilder& b, const Vector3& foot, const Vector3& axis, double outer, double inner,
             double height);
/// A plug with collar, latch and `pins` contacts; `face` is the centre of its mating side, `axis` (unit)
/// points away from that side, `size` [m] is the cross-section.
void addConnector(MeshBuilder& b, const Vector3& face, const Vector3& axis, const Vector2& size, int pins,
                  Color color);
/// A hose clamp of `radius` [m] with its screw.
void addClamp(MeshBuilder& b, const Vector3& centre, const Vector3& axis, double radius);
/// A grooved belt pulley of `radius` [m] and `width` [m], its middle at `centre`.
void addPulley(MeshBuilder& b, const Vector3& centre, const Vector3& axis, double radius, double width);

/// Frames for extrusion of prisms: polygons of (y, z) along +x.
[[nodiscard]] Pose alongX();
/// Polygons of (z, x) along +y.
[[nodiscard]] Pose alongY();

}  // namespace tenon::part_generator
