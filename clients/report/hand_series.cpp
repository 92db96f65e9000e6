#include "clients/report/hand_series.h"

#include <limits>

namespace tenon::report {

void HandSeries::add(const DeviceInput& input) {
  const DeviceSample& newest = input.sample;
  const InputNumber before = sent.empty() ? InputNumber{} : sent.back().number;
  sent.push_back({before.followedBy(newest.seq), newest.X_WH.translation().cast<float>()});
}

void HandSeries::add(const HandManifold& manifold) {
  // in lockstep a server repeats what a station has not answered
  if (!samples.empty() && samples.back().tick >= manifold.tick) return;
  const double force = manifold.F_Ho_W.force.norm();
  const double extension =
      manifold.stiffness > 0.0 ? force / manifold.stiffness : std::numeric_limits<double>::quiet_NaN();
  const Vector3 p_WH_proxy = (manifold.X_WO * manifold.X_HO.inverse()).translation();
  const InputNumber before = samples.empty() ? InputNumber{} : samples.back().answers;
  samples.push_back({manifold.tick, manifold.object, before.followedBy(manifold.answers_seq), force,
                     p_WH_proxy.cast<float>(), extension});
}

HandFigures evaluate(const HandSeries& hand, const std::function<bool(ObjectId, Tick)>& touches) {
  HandFigures figures;
  auto sent = hand.sent.begin();
  for (const HandSample& sample : hand.samples) {
    addPoint(figures.force, sample.tick, sample.force);
    const bool in_contact = touches(sample.object, sample.tick);
    if (in_contact) addPoint(figures.contact_force, sample.tick, sample.force);
    addPoint(figures.contact, sample.tick, in_contact ? 1.0 : 0.0);
    // distance of the proxy's hand pose from the device's; without the input, the extension of the coupling
    while (sent != hand.sent.end() && sent->number < sample.answers) ++sent;
    const bool is_answer =
        sent != hand.sent.end() && sent->number == sample.answers && sample.answers.seq != 0;
    const double distance = is_answer ? (sample.p_WH_proxy - sent->p_WH).norm() : sample.extension;
    addPoint(figures.gap, sample.tick, distance);
  }
  return figures;
}

}  // namespace tenon::report
