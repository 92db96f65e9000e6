#include "scenarios/part_generator/engine_bay_builders.h"
#include "scenarios/part_generator/scenario_parts.h"

namespace tenon::part_generator {
namespace {

PartMesh makeBay(double detail) {
  MeshBuilder b(detail);
  for (const auto add :
       {engine_bay::addPlatform, engine_bay::addBody, engine_bay::addPanels, engine_bay::addEngine,
        engine_bay::addCooling, engine_bay::addAncillaries, engine_bay::addLines, engine_bay::addPockets}) {
    b.at(Pose());
    add(b);
  }
  return b.take();
}

}  // namespace

PartSet engineBayParts() {
  using namespace engine_bay;
  return {"engine_bay",
          0.12,
          {{"engine_bay", "the front of a car in its assembly frame", makeBay},
           {"control_box", "control box with cooling ribs and connectors", makeControlBox},
           {"covering_board", "covering board with ribs and clips", makeCoveringBoard},
           {"grid", "radiator grid with bars", makeGrid},
           {"bracket", "bent sheet bracket with holes", makeBracket},
           {"wiper_mechanism", "wiper linkage with motor, crank and pivots", makeWiperMechanism},
           {"drill", "drill for the other hand", makeDrill},
           {"haptic_pointer", "haptic pointer, a sphere of 12 mm radius", makePointer},
           {"forearm", "forearm, elbow to wrist 0.26 m", makeForearm},
           {"assistant", "teaching assistant, a cube of 50 mm", makeAssistant},
           {"head", "the trainee's head, for display only", makeHead}}};
}

}  // namespace tenon::part_generator
