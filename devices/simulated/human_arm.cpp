#include "devices/simulated/human_arm.h"

#include <algorithm>
#include <cmath>

namespace tenon {
namespace {

Vector3 shortened(const Vector3& v, double longest) {
  const double length = v.norm();
  return length > longest ? Vector3(v * (longest / length)) : v;
}

ArmImpedance braced(double relaxed, double tense, double damping, double contraction) {
  const double stiffness = relaxed + contraction * (tense - relaxed);
  return {stiffness, damping * std::sqrt(stiffness / relaxed)};
}

}  // namespace

HumanArm::HumanArm(const HumanArmModel& model) noexcept : model_(model) {}

void HumanArm::intend(const Pose& X_DI, const Twist& V_DI) noexcept {
  X_DI_ = X_DI;
  V_DI_ = V_DI;
}

void HumanArm::stiffen(double contraction) noexcept { contraction_ = std::clamp(contraction, 0.0, 1.0); }

ArmImpedance HumanArm::impedance() const noexcept {
  return braced(model_.stiffness, model_.stiffness_braced, model_.damping, contraction_);
}

ArmImpedance HumanArm::rotationalImpedance() const noexcept {
  return braced(model_.rotational_stiffness, model_.rotational_stiffness_braced, model_.rotational_damping,
                contraction_);
}

Displacement HumanArm::reach(const Pose& X_DH) const noexcept {
  const Displacement full = displacement(X_DH, X_DI_);
  return {shortened(full.translation, model_.strength / impedance().stiffness),
          shortened(full.rotation, model_.rotational_strength / rotationalImpedance().stiffness)};
}

void HumanArm::moved(const Pose& X_DH, const Twist& V_DH, const Wrench& F_Ho_D_felt) noexcept {
  X_DH_ = X_DH;
  V_DH_ = V_DH;
  F_Ho_D_felt_ = F_Ho_D_felt;
}

void HumanArm::moveFreely(double dt) noexcept {
  const Displacement pull = reach(X_DH_);
  const auto step = [dt](double inertia, const ArmImpedance& arm, const Vector3& v, const Vector3& v_intent,
                         const Vector3& pulled) -> Vector3 {
    return (inertia * v + dt * (arm.stiffness * pulled + arm.damping * v_intent)) /
           (inertia + dt * arm.damping + dt * dt * arm.stiffness);
  };
  V_DH_.linear = step(model_.mass, impedance(), V_DH_.linear, V_DI_.linear, pull.translation);
  V_DH_.angular = step(model_.inertia, rotationalImpedance(), V_DH_.angular, V_DI_.angular, pull.rotation);
  X_DH_ = displaced(X_DH_, {dt * V_DH_.linear, dt * V_DH_.angular});
  F_Ho_D_felt_ = {};
}

}  // namespace tenon
