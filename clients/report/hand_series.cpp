#include "clients/report/hand_series.h"

#include <algorithm>
#include <limits>

namespace tenon::report {

void HandSeries::add(const DeviceInput& input) {
  const DeviceSample& newest = input.sample;
  const InputNumber before = sent.empty() ? InputNumber{} : sent.back().number;
  sent.push_back({before.followedBy(newest.seq), newest.X_WH.translation().cast<float>()});
}

void HandSeries::add(const HandState& state) {
  const InputNumber before = displayed.empty() ? InputNumber{} : displayed.back().number;
  const double force = state.F_Ho_W.force.norm();
  displayed.push_back(
      {before.followedBy(state.seq), force, std::max(static_cast<double>(state.peak_force), force)});
}

void HandSeries::add(const HandManifold& manifold) {
  // in lockstep a server repeats what a station has not answered
  if (!samples.empty() && samples.back().tick >= manifold.tick) return;
  const double force = manifold.F_Ho_W.force.norm();
  const double extension =
      manifold.stiffness > 0.0 ? force / manifold.stiffness : std::numeric_limits<double>::quiet_NaN();
  const Vector3 p_WH_proxy = (manifold.X_WO * manifold.X_HO.inverse()).translation();
  const InputNumber before = samples.empty() ? InputNumber{} : samples.back().answers;
  samples.push_back({manifold.tick, manifold.object, before.followedBy(manifold.answers_seq), manifold.frozen,
                     p_WH_proxy.cast<float>(), extension});
}

HandFigures evaluate(const HandSeries& hand, const std::function<bool(ObjectId, Tick)>& touches) {
  HandFigures figures;
  auto sent = hand.sent.begin();
  auto displayed = hand.displayed.begin();
  InputNumber before = hand.samples.empty() ? InputNumber{} : hand.samples.front().answers;
  for (const HandSample& sample : hand.samples) {
    const bool is_same_station = before.beginnings == sample.answers.beginnings;
    addPoint(figures.answered, sample.tick,
             is_same_station ? static_cast<double>(sample.answers.seq - before.seq) : 0.0);
    before = sample.answers;
    const bool in_contact = !sample.frozen && touches(sample.object, sample.tick);
    addPoint(figures.contact, sample.tick, in_contact ? 1.0 : 0.0);
    for (; displayed != hand.displayed.end() && displayed->number <= sample.answers; ++displayed) {
      addPoint(figures.stated, sample.tick, 1.0);
      if (sample.frozen) continue;
      addPoint(figures.force, sample.tick, displayed->peak);
      if (in_contact) addPoint(figures.contact_force, sample.tick, displayed->force);
    }
    if (sample.frozen) continue;
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
