#include "tests/system/rehearsal.h"

#include <chrono>

#include "idl/types/names.h"
#include "server/session/broadcast.h"
#include "server/session/front_desk.h"
#include "server/session/session_server.h"

namespace tenon {
namespace {

constexpr std::uint32_t kServerEpoch = 1;

std::vector<SceneObject> sceneObjects(const Scene& scene) {
  std::vector<SceneObject> objects;
  for (std::uint32_t i = 0; i < scene.objects.size(); ++i)
    objects.push_back(describe(ObjectId{i}, scene.objects[i]));
  return objects;
}

class Rehearsal {
 public:
  Rehearsal(const LoadedScene& loaded, std::vector<std::unique_ptr<Station>> stations,
            const RehearsalOptions& options)
      : options_(options),
        stations_(std::move(stations)),
        desk_(*loaded.scenario, kServerEpoch, true, options.seed),
        exercise_(loaded.scenario, loaded.scene, exerciseOptions(loaded, options)),
        broadcast_(loaded.scenario, kServerEpoch, true),
        objects_(sceneObjects(*loaded.scene)),
        output_(exercise_.makeOutput()) {}

  Result<RehearsalReport> run() {
    for (std::size_t i = 0; i < stations_.size(); ++i)
      if (auto seated = seat(i); !seated) return fail(seated.error().what);
    desk_.takeChanges(input_.changes);
    if (!options_.collisions) listScenePairs();
    const auto last = static_cast<Tick>(options_.seconds / kTickSeconds);
    while (!exercise_.over() && exercise_.now() < last && !(options_.enough && options_.enough())) tick();
    RehearsalReport report;
    report.phase = exercise_.phase();
    report.ticks = exercise_.now();
    report.final_hash = exercise_.hash();
    report.reason = reason_;
    return report;
  }

 private:
  static ExerciseOptions exerciseOptions(const LoadedScene& loaded, const RehearsalOptions& options) {
    ExerciseOptions all;
    all.environment.workers = options.workers;
    all.needed_hands = traineeHands(*loaded.scenario);
    return all;
  }

  Result<void> seat(std::size_t i) {
    Station& station = *stations_[i];
    Join join;
    join.client_guid = std::to_string(i);
    join.name = std::string(roleName(station.role()));
    join.role = station.role();
    join.hands = station.handNames();
    const Welcome welcome = desk_.join(join, 0);
    if (!welcome.accepted) return fail(welcome.reason);
    station.welcome(welcome, objects_);
    return {};
  }

  void tick() {
    const Tick now = exercise_.now() + 1;
    input_.tick = now;
    for (const auto& station : stations_) {
      station->step(static_cast<std::uint32_t>(now));
      for (const DeviceInput& input : station->inputs())
        if (const auto reading = desk_.reading(input)) input_.readings.push_back(*reading);
    }
    switchOffCollisions();
    const auto begin = std::chrono::steady_clock::now();
    exercise_.tick(input_);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    exercise_.fill(output_);
    output_.stats.compute_seconds = took.count();
    if (options_.ticked) options_.ticked(input_, output_);
    deliver(broadcast_.read(output_));
    input_.readings.clear();
    input_.changes.clear();
  }

  void listScenePairs() {
    const Scene& scene = exercise_.environment().scene();
    const auto isScene = [&](ObjectId id) { return scene.objects[id.value].kind == "scene"; };
    for (std::uint32_t i = 0; i < scene.pairs.size(); ++i)
      if (isScene(scene.pairs[i].a) || isScene(scene.pairs[i].b)) to_switch_off_.push_back(i);
  }

  void switchOffCollisions() {
    while (!to_switch_off_.empty() && !input_.changes.full()) {
      input_.changes.push_back({.kind = ChangeKind::kPair, .index = to_switch_off_.back(), .value = 0.0});
      to_switch_off_.pop_back();
    }
  }

  void deliver(const Outgoing& outgoing) {
    for (const auto& station : stations_) {
      if (outgoing.news.step) station->receive(*outgoing.news.step);
      for (const GrabState& grab : outgoing.news.grabs) station->receive(grab);
      for (const WorldFrame& frame : outgoing.frames) station->receive(frame);
      for (const HandManifold* manifold : outgoing.manifolds) station->receive(*manifold);
    }
    if (outgoing.news.run) reason_ = outgoing.news.run->reason;
    if (!options_.heard) return;
    for (const EventLog& event : outgoing.news.events) options_.heard(event);
  }

  RehearsalOptions options_;
  std::vector<std::unique_ptr<Station>> stations_;
  FrontDesk desk_;
  Exercise exercise_;
  Broadcast broadcast_;
  std::vector<SceneObject> objects_;
  TickInput input_;
  TickOutput output_;
  std::string reason_;
  std::vector<std::uint32_t> to_switch_off_;
};

}  // namespace

Result<RehearsalReport> rehearse(const LoadedScene& loaded, std::vector<std::unique_ptr<Station>> stations,
                                 const RehearsalOptions& options) {
  return Rehearsal(loaded, std::move(stations), options).run();
}

}  // namespace tenon
