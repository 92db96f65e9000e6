#pragma once

#include "scenarios/part_generator/mesh_builder.h"

/// Assemblies of the engine bay's mesh, each of which adds its shells in W, and the other meshes of the
/// scenario in their own frames.
namespace tenon::part_generator::engine_bay {

void addPlatform(MeshBuilder& b);  ///< the steel frame that carries the car's front: the bay's outer size
void addBody(MeshBuilder& b);      ///< rails, crossmembers, firewall, strut towers
void addPanels(MeshBuilder& b);    ///< fenders, pillars, lamps, wheels
void addEngine(MeshBuilder& b);
void addCooling(MeshBuilder& b);
void addAncillaries(MeshBuilder& b);  ///< battery, brakes, tanks
void addLines(MeshBuilder& b);        ///< hoses, pipes, wiring
void addPockets(MeshBuilder& b);      ///< for the tongues of the five parts: flat faces, exact at any detail

[[nodiscard]] PartMesh makeControlBox(double detail);      ///< `detail` [-] 0 to 1
[[nodiscard]] PartMesh makeCoveringBoard(double detail);   ///< `detail` [-] 0 to 1
[[nodiscard]] PartMesh makeGrid(double detail);            ///< `detail` [-] 0 to 1
[[nodiscard]] PartMesh makeBracket(double detail);         ///< `detail` [-] 0 to 1
[[nodiscard]] PartMesh makeWiperMechanism(double detail);  ///< `detail` [-] 0 to 1
[[nodiscard]] PartMesh makeDrill(double detail);           ///< `detail` [-] 0 to 1
[[nodiscard]] PartMesh makePointer(double detail);         ///< `detail` [-] 0 to 1
[[nodiscard]] PartMesh makeForearm(double detail);         ///< `detail` [-] 0 to 1
[[nodiscard]] PartMesh makeAssistant(double detail);       ///< `detail` [-] 0 to 1
[[nodiscard]] PartMesh makeHead(double detail);            ///< `detail` [-] 0 to 1

}  // namespace tenon::part_generator::engine_bay
