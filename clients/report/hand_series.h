#pragma once

#include <compare>
#include <cstdint>
#include <functional>
#include <vector>

#include "clients/report/series.h"
#include "idl/types/ids.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/role.h"
#include "idl/types/spatial.h"

namespace tenon::report {

/// Number of an input, and how often the numbers of its hand had begun anew before (with a new station).
struct InputNumber {
  std::uint32_t beginnings = 0;
  std::uint32_t seq = 0;

  auto operator<=>(const InputNumber&) const = default;
  [[nodiscard]] InputNumber followedBy(std::uint32_t next) const {
    return {beginnings + (next < seq ? 1 : 0), next};
  }
};

struct SentPose {
  InputNumber number;
  Eigen::Vector3f p_WH = Eigen::Vector3f::Zero();  ///< as float: there is one a tick
};

/// The force that a device has displayed, from its station.
struct DisplayedForce {
  InputNumber number;  ///< of the input in whose client tick
  double force = 0.0;  ///< [N]
  double peak = 0.0;   ///< [N] largest since the last sample
};

/// What a manifold says of its hand.
struct HandSample {
  Tick tick = 0;
  ObjectId object;
  InputNumber answers;
  bool frozen = false;
  Eigen::Vector3f p_WH_proxy = Eigen::Vector3f::Zero();
  double extension = 0.0;  ///< [m] of the coupling; not a number without one
};

/// What a recording says of one hand.
struct HandSeries {
  Role role = Role::kTrainee;
  std::vector<SentPose> sent;
  std::vector<HandSample> samples;
  std::vector<DisplayedForce> displayed;

  void add(const DeviceInput& input);
  void add(const HandState& state);
  void add(const HandManifold& manifold);
};

/// The forces and distances of a hand, sorted by time: none while the server held the hand's object still.
struct HandFigures {
  Series force;          ///< [N] displayed on the hand
  Series contact_force;  ///< [N] while its object is in contact
  Series contact;        ///< [-] 1 while its object is in contact, else 0
  Series gap;            ///< [m] between the device and the proxy
  Series answered;       ///< [-] inputs of the station, since the sample before
  Series stated;         ///< [-] 1 for each state of the hand that the station has said
};

/// `touches`: whether an object is in contact at a tick.
[[nodiscard]] HandFigures evaluate(const HandSeries& hand,
                                   const std::function<bool(ObjectId object, Tick tick)>& touches);

}  // namespace tenon::report
