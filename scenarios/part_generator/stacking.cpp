#include "scenarios/part_generator/mesh_builder.h"
#include "scenarios/part_generator/scenario_parts.h"

namespace tenon::part_generator {
namespace {

/// A table top of 600 x 400 x 30 mm, origin at the centre of its upper face, z up.
PartMesh tableTop(double detail) {
  MeshBuilder b(detail);
  b.paint(0xB08D57);
  b.box({-0.300, -0.200, -0.030}, {0.300, 0.200, 0.0});
  return b.take();
}

/// A block of 60 mm, origin at its centre. Scenarios tell several of it apart by their colours.
PartMesh block(double detail) {
  MeshBuilder b(detail);
  b.paint(kUnpainted);
  b.box(Vector3::Constant(-0.030), Vector3::Constant(0.030));
  return b.take();
}

PartMesh fingertip(double detail) {
  MeshBuilder b(detail);
  b.paint(0xE02020);
  b.sphere(Vector3::Zero(), 0.012);
  return b.take();
}

PartMesh assistantCube(double detail) {
  MeshBuilder b(detail);
  b.paint(0x2F6FE0);
  b.box(Vector3::Constant(-0.025), Vector3::Constant(0.025));
  return b.take();
}

}  // namespace

PartSet stackingParts() {
  return {"stacking",
          0.3,
          {{"table", "table top of 600 x 400 mm", tableTop},
           {"block", "block of 60 mm", block},
           {"pointer", "haptic pointer, a sphere of 12 mm radius", fingertip},
           {"cube", "teaching assistant, a cube of 50 mm", assistantCube}}};
}

}  // namespace tenon::part_generator
