#include <cmath>

#include "server/game_control/scenario_reader.h"
#include "server/structures/volume.h"

namespace tenon::game_control {
namespace {

constexpr double kLeastMass = 1e-6;        // [kg]
constexpr double kLargestMass = 1e4;       // [kg]
constexpr double kLeastDensity = 1.0;      // [kg/m^3]
constexpr double kLargestDensity = 3e4;    // [kg/m^3]
constexpr double kLargestDamping = 100.0;  // [1/s]
constexpr double kLargestFriction = 10.0;  // [-]

/// [m^3] Below a cubic millimetre the enclosed volume is discretisation error of the field of a sheet.
constexpr double kLeastVolume = 1e-9;

/// [m] Limits of a plausible radius of gyration.
constexpr double kLeastGyration = 1e-5;
constexpr double kLargestGyration = 10.0;

/// Triangle inequality of principal moments of inertia [kg m^2]: none exceeds the sum of the other two.
bool arePhysicalMoments(const Vector3& moments) {
  return moments.minCoeff() > 0.0 && 2.0 * moments.maxCoeff() <= moments.sum();
}

}  // namespace

void ScenarioReader::readBody(const YAML::Node& node, ScenarioObject& object) {
  const std::string of = " of 'body' of object '" + object.name + "'";
  if (!yaml_.openMapping(node, "body", "'body' of object '" + object.name + "'")) return;
  ScenarioBody body;
  body.line = yaml_.lineOf(node);
  if (node["mass"].IsDefined() == node["density"].IsDefined()) {
    yaml_.fail(node, "'body' of object '" + object.name + "' needs either 'mass' or 'density'");
  }
  if (node["mass"].IsDefined())
    body.mass = yaml_.number(node["mass"], Quantity::kMass, "'mass'" + of, kLeastMass, kLargestMass);
  body.density = yaml_.numberOr(node["density"], Quantity::kDensity, "'density'" + of, kLeastDensity,
                                kLargestDensity, 0.0);
  if (node["centre"].IsDefined())
    body.p_OC_O = yaml_.vector(node["centre"], Quantity::kLength, "'centre'" + of);
  if (node["inertia"].IsDefined()) {
    body.inertia_C = yaml_.vector(node["inertia"], Quantity::kPlain, "'inertia'" + of);
    if (!arePhysicalMoments(*body.inertia_C)) {
      yaml_.fail(node["inertia"], "'inertia'" + of +
                                      " is not physical, expected three moments above 0, none larger than "
                                      "the sum of the other two");
    }
    const double mass = body.mass.value_or(kLeastMass);
    if (body.inertia_C->minCoeff() < mass * kLeastGyration * kLeastGyration ||
        body.inertia_C->maxCoeff() > mass * kLargestGyration * kLargestGyration) {
      yaml_.fail(node["inertia"], "'inertia'" + of +
                                      " does not fit its mass, expected a radius of gyration between "
                                      "0.01 mm and 10 m");
    }
    if (!body.mass || !body.p_OC_O)
      yaml_.fail(node["inertia"], "'inertia'" + of + " needs 'mass' and 'centre' with it");
  }
  body.floating = yaml_.boolean(node["floating"], "'floating'" + of, body.floating);
  body.damping =
      yaml_.numberOr(node["damping"], Quantity::kPlain, "'damping'" + of, 0.0, kLargestDamping, 0.0);
  body.friction = yaml_.numberOr(node["friction"], Quantity::kPlain, "'friction'" + of, 0.0, kLargestFriction,
                                 body.friction);
  if (!object.collidable)
    yaml_.fail(node, "object '" + object.name + "' is not collidable, it cannot have a 'body'");
  object.body = body;
}

Result<simulation::BodySpec> bodyOf(const ScenarioObject& object,
                                    const structures::HapticStructures& structures) {
  const ScenarioBody& given = *object.body;
  simulation::BodySpec body;
  body.floating = given.floating;
  body.damping = given.damping;
  body.friction = given.friction;
  if (given.p_OC_O && !structures.field.box().contains(*given.p_OC_O)) {
    return fail("object '" + object.name + "': the 'centre' of its 'body' is outside it");
  }
  if (given.inertia_C) {
    body.mass = *given.mass;
    body.p_OC_O = *given.p_OC_O;
    body.inertia_C_O = given.inertia_C->asDiagonal();
    return body;
  }
  const structures::Volume volume = structures::volumeOf(structures.field);
  if (volume.volume < kLeastVolume) {
    return fail("object '" + object.name +
                "' encloses no volume to compute its inertia from, expected 'mass', 'centre' and 'inertia' "
                "in its 'body'");
  }
  body.mass = given.mass.value_or(given.density * volume.volume);
  body.p_OC_O = given.p_OC_O.value_or(volume.p_MC_M);
  body.inertia_C_O = (body.mass / volume.volume) * volume.inertia_C_M;
  return body;
}

}  // namespace tenon::game_control
