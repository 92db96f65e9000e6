#include "devices/simulated/human_arm.h"

#include <algorithm>
#include <cmath>

namespace tenon::devices {
namespace {

ArmImpedance contractedImpedance(double relaxed, double braced, double damping, double contraction) {
  const double stiffness = relaxed + contraction * (braced - relaxed);
  return {stiffness, damping * std::sqrt(stiffness / relaxed)};
}

}  // namespace

HumanArm::HumanArm(const HumanArmModel& model) noexcept : model_(model) {}

void HumanArm::setIntent(const Pose& X_DI, const Twist& V_DI) noexcept {
  X_DI_ = X_DI;
  V_DI_ = V_DI;
}

void HumanArm::setContraction(double contraction) noexcept {
  contraction_ = std::clamp(contraction, 0.0, 1.0);
}

ArmImpedance HumanArm::impedance() const noexcept {
  return contractedImpedance(model_.stiffness, model_.stiffness_braced, model_.damping, contraction_);
}

ArmImpedance HumanArm::rotationalImpedance() const noexcept {
  return contractedImpedance(model_.rotational_stiffness, model_.rotational_stiffness_braced,
                             model_.rotational_damping, contraction_);
}

Displacement HumanArm::springStretch(const Pose& X_DH) const noexcept {
  const Displacement full = displacement(X_DH, X_DI_);
  return {clampNorm(full.translation, model_.strength / impedance().stiffness),
          clampNorm(full.rotation, model_.rotational_strength / rotationalImpedance().stiffness)};
}

void HumanArm::setState(const Pose& X_DH, const Twist& V_DH, const Wrench& F_Ho_D) noexcept {
  X_DH_ = X_DH;
  V_DH_ = V_DH;
  F_Ho_D_ = F_Ho_D;
}

void HumanArm::stepFree(double dt) noexcept {
  const Displacement stretch = springStretch(X_DH_);
  const auto step = [dt](double inertia, const ArmImpedance& arm, const Vector3& v, const Vector3& v_intent,
                         const Vector3& spring_stretch) -> Vector3 {
    return (inertia * v + dt * (arm.stiffness * spring_stretch + arm.damping * v_intent)) /
           (inertia + dt * arm.damping + dt * dt * arm.stiffness);
  };
  V_DH_.linear = step(model_.mass, impedance(), V_DH_.linear, V_DI_.linear, stretch.translation);
  V_DH_.angular = step(model_.inertia, rotationalImpedance(), V_DH_.angular, V_DI_.angular, stretch.rotation);
  X_DH_ = displaced(X_DH_, {dt * V_DH_.linear, dt * V_DH_.angular});
  F_Ho_D_ = {};
}

}  // namespace tenon::devices
