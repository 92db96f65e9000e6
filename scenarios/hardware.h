#pragma once

#include <span>

#include "scenarios/mesh_builder.h"

/// The small things every machine is full of, each as several overlapping shells.
namespace tenon {

/// A hexagon bolt's head with washer and shank, standing on `seat`, head towards `axis` (unit); `size` is the
/// thread's diameter.
void addHexBolt(MeshBuilder& b, const Vector3& seat, const Vector3& axis, double size);
/// `count` bolts evenly from one seat to another.
void addBoltRow(MeshBuilder& b, const Vector3& first, const Vector3& last, int count, const Vector3& axis,
                double size);
/// A round boss with a blind hole.
void addBoss(MeshBuilder& b, const Vector3& foot, const Vector3& axis, double outer, double inner,
             double height);
/// A plug with collar, latch and `pins` contacts; `face` is the middle of the side it plugs into, axis away
/// from it.
void addConnector(MeshBuilder& b, const Vector3& face, const Vector3& axis, const Vector2& size, int pins,
                  Color color);
/// A hose clamp with its screw.
void addClamp(MeshBuilder& b, const Vector3& centre, const Vector3& axis, double radius);
/// A grooved belt pulley of radius r and width w, its middle at `centre`.
void addPulley(MeshBuilder& b, const Vector3& centre, const Vector3& axis, double radius, double width);

/// Frames to extrude in: polygons of (y, z) along +x, and of (z, x) along +y.
[[nodiscard]] Pose alongX();
[[nodiscard]] Pose alongY();

}  // namespace tenon
