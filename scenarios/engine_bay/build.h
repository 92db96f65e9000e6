#pragma once

#include "scenarios/mesh_builder.h"

/// What the engine bay's mesh is put together from; each adds its shells in W.
namespace tenon::engine_bay {

void addPlatform(MeshBuilder& b);  ///< the steel frame that the car's front stands in: the bay's outer size
void addBody(MeshBuilder& b);      ///< rails, crossmembers, firewall, strut towers
void addPanels(MeshBuilder& b);    ///< fenders, pillars, lamps, wheels
void addEngine(MeshBuilder& b);
void addCooling(MeshBuilder& b);
void addAncillaries(MeshBuilder& b);  ///< battery, brakes, tanks
void addLines(MeshBuilder& b);        ///< hoses, pipes, wiring
void addPockets(MeshBuilder& b);      ///< where the five parts go in: flat faces, exact at any detail

[[nodiscard]] PartMesh makeControlBox(double detail);
[[nodiscard]] PartMesh makeCoveringBoard(double detail);
[[nodiscard]] PartMesh makeGrid(double detail);
[[nodiscard]] PartMesh makeBracket(double detail);
[[nodiscard]] PartMesh makeWiperMechanism(double detail);
[[nodiscard]] PartMesh makeDrill(double detail);
[[nodiscard]] PartMesh makePointer(double detail);
[[nodiscard]] PartMesh makeForearm(double detail);
[[nodiscard]] PartMesh makeAssistant(double detail);
[[nodiscard]] PartMesh makeHead(double detail);

}  // namespace tenon::engine_bay
