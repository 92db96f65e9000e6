#include "clients/simulated_person/reach_controller.h"

namespace tenon::simulated_person {

namespace {
constexpr double kGain = 4.0;        // [1/s] velocity command per position error
constexpr double kSmoothing = 0.06;  // [s] time constant of each of the two filter stages
}  // namespace

void ReachController::start(const Pose& X_WH) noexcept {
  X_WH_ = X_WH;
  velocity_ = {};
  filtered_once_ = {};
}

void ReachController::step(const Pose& X_WG, double max_speed, double max_turn_speed, double dt) noexcept {
  const Displacement error = displacement(X_WH_, X_WG);
  const double blend = dt / kSmoothing;
  filtered_once_.linear += blend * (clampNorm(kGain * error.translation, max_speed) - filtered_once_.linear);
  filtered_once_.angular +=
      blend * (clampNorm(kGain * error.rotation, max_turn_speed) - filtered_once_.angular);
  velocity_.linear += blend * (filtered_once_.linear - velocity_.linear);
  velocity_.angular += blend * (filtered_once_.angular - velocity_.angular);
  X_WH_ = displaced(X_WH_, {dt * velocity_.linear, dt * velocity_.angular});
}

bool ReachController::stayWithin(const Vector3& p_WC, double radius) noexcept {
  const Vector3 p_CH = X_WH_.translation() - p_WC;
  const double distance = p_CH.norm();
  if (distance <= radius) return false;
  X_WH_.translation() = p_WC + p_CH * (radius / distance);
  return true;
}

}  // namespace tenon::simulated_person
