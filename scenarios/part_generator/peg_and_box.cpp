#include "scenarios/part_generator/mesh_builder.h"
#include "scenarios/part_generator/scenario_parts.h"

namespace tenon::part_generator {
namespace {

/// A box of 200 x 200 x 80 mm with a square hole of 40.0 mm, 60 mm deep; origin at the centre of its top
/// face, z up.
PartMesh boxWithHole(double detail) {
  MeshBuilder b(detail);
  b.paint(0x8FA3B5);
  const double hole = 0.020;
  // four blocks round the hole and its floor: overlapping solids
  b.box({-0.100, -0.100, -0.080}, {-hole, 0.100, 0.0});
  b.box({hole, -0.100, -0.080}, {0.100, 0.100, 0.0});
  b.box({-0.100, -0.100, -0.080}, {0.100, -hole, 0.0});
  b.box({-0.100, hole, -0.080}, {0.100, 0.100, 0.0});
  b.box({-0.100, -0.100, -0.080}, {0.100, 0.100, -0.060});
  return b.take();
}

/// A peg, 39.5 mm square and 100 mm long, origin at the centre of its bottom face, z up.
PartMesh peg(double detail) {
  MeshBuilder b(detail);
  b.paint(0xE0A040);
  b.chamferedTongue({-0.01975, -0.01975, 0.0}, {0.01975, 0.01975, 0.100}, 0.001);
  return b.take();
}

PartMesh pointer(double detail) {
  MeshBuilder b(detail);
  b.paint(0xE02020);
  b.sphere(Vector3::Zero(), 0.012);
  return b.take();
}

PartMesh cube(double detail) {
  MeshBuilder b(detail);
  b.paint(0x2F6FE0);
  b.box(Vector3::Constant(-0.025), Vector3::Constant(0.025));
  return b.take();
}

}  // namespace

PartSet pegAndBoxParts() {
  return {"peg_and_box",
          0.3,
          {{"box_with_hole", "box with a square hole of 40.0 mm", boxWithHole},
           {"peg", "square peg of 39.5 mm", peg},
           {"pointer", "haptic pointer, a sphere of 12 mm radius", pointer},
           {"cube", "teaching assistant, a cube of 50 mm", cube}}};
}

}  // namespace tenon::part_generator
