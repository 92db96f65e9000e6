#include "clients/rehearse/rehearsal.h"

#include <chrono>
#include <cmath>

#include "clients/rehearse/measured_link.h"
#include "idl/types/names.h"
#include "server/session/journal.h"
#include "server/session/publisher.h"
#include "server/session/session_registry.h"
#include "server/session/start_condition.h"

namespace tenon::rehearse {
namespace {

constexpr std::uint32_t kServerEpoch = 1;

std::vector<SceneObject> sceneObjects(const simulation::Scene& scene) {
  std::vector<SceneObject> objects;
  for (std::uint32_t i = 0; i < scene.objects.size(); ++i)
    objects.push_back(session::describe(ObjectId{i}, scene.objects[i]));
  return objects;
}

class Rehearsal {
 public:
  Rehearsal(const session::LoadedScene& loaded, std::vector<std::unique_ptr<haptic::Station>> stations,
            const RehearsalOptions& options)
      : options_(options),
        stations_(std::move(stations)),
        registry_(*loaded.scenario, kServerEpoch, true),
        simulation_(loaded.scenario, loaded.scene, simulationOptions(loaded, options)),
        publisher_(loaded.scenario, kServerEpoch, true),
        objects_(sceneObjects(*loaded.scene)),
        output_(simulation_.makeOutput()) {
    entry_.checkpoint.reserve(simulation_.maxSavedBytes());
    for (std::size_t i = 0; i < stations_.size(); ++i)
      links_.push_back(i < options.links.size() && options.links[i]
                           ? std::make_unique<MeasuredLink>(*options.links[i], loaded.scene->hands.size())
                           : nullptr);
  }

  Result<RehearsalReport> run() {
    for (std::size_t i = 0; i < stations_.size(); ++i)
      if (auto joined = join(i); !joined) return fail(joined.error().what);
    registry_.takeChanges(input_.changes);
    listChanges();
    const auto last = static_cast<Tick>(std::llround(options_.seconds / kTickSeconds));
    while (!simulation_.over() && simulation_.now() < last && !(options_.stop_when && options_.stop_when()))
      tick();
    RehearsalReport report;
    report.phase = simulation_.phase();
    report.completed = isCompleted({.phase = simulation_.phase(),
                                    .steps_skipped = simulation_.step().skipped,
                                    .steps_timed_out = simulation_.step().timed_out});
    report.ticks = simulation_.now();
    report.final_hash = simulation_.hash();
    report.reason = reason_;
    report.crowded_ticks = crowded_ticks_;
    return report;
  }

 private:
  static session::SessionSimulationOptions simulationOptions(const session::LoadedScene& loaded,
                                                             const RehearsalOptions& options) {
    session::SessionSimulationOptions all;
    all.environment.workers = options.workers;
    all.needed_hands = options.needed_hands.value_or(session::traineeHands(*loaded.scenario));
    return all;
  }

  Result<void> join(std::size_t i) {
    haptic::Station& station = *stations_[i];
    Join request;
    request.client_guid = std::to_string(i);
    request.name = std::string(roleName(station.role()));
    request.role = station.role();
    request.hands = station.handNames();
    request.stiffness = station.stiffness();
    const Welcome welcome = registry_.join(request, {.key = true}, 0);
    if (!welcome.accepted) return fail(welcome.reason);
    station.welcome(welcome, objects_);
    clients_.push_back(welcome.client);
    return {};
  }

  void tick() {
    const Tick now = simulation_.now() + 1;
    input_.tick = now;
    for (std::size_t i = 0; i < stations_.size(); ++i) {
      haptic::Station& station = *stations_[i];
      MeasuredLink* const link = links_[i].get();
      if (link != nullptr) link->deliver(now, station);
      static_cast<void>(station.armDevices());  // a fault of a simulated device is in its events
      station.step(static_cast<std::uint32_t>(now));
      if (link == nullptr) {
        for (const DeviceInput& input : station.inputs()) receive(input);
        continue;
      }
      link->send(station.inputs(), now);
      link->receive(now, clients_[i], registry_, input_.readings, options_.on_refused);
    }
    registry_.takeChanges(input_.changes);
    while (!changes_.empty() && input_.changes.push_back(changes_.back())) changes_.pop_back();
    const auto begin = std::chrono::steady_clock::now();
    simulation_.tick(input_);
    simulation_.fill(output_);
    crowded_ticks_ += simulation_.environment().work().contacts_dropped > 0 ? 1 : 0;
    fillEntry();
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    output_.stats.compute_seconds = took.count();
    if (options_.on_tick) options_.on_tick(simulation_, input_, output_);
    deliver(publisher_.prepare(output_));
    input_.readings.clear();
    input_.changes.clear();
  }

  void receive(const DeviceInput& input) {
    if (const auto reading = registry_.validateDeviceInput(input)) {
      input_.readings.push_back(*reading);
    } else if (options_.on_refused) {
      options_.on_refused(input, reading.error().what);
    }
  }

  /// What the server's tick thread hands to its journal thread; here nobody takes it.
  void fillEntry() {
    entry_.input = input_;
    entry_.hash = output_.hash;
    entry_.checkpoint.clear();
    if (session::hasCheckpoint(input_.tick)) simulation_.save(entry_.checkpoint);
  }

  /// Changes for the first ticks, the last one first.
  void listChanges() {
    const simulation::Scene& scene = simulation_.environment().scene();
    const auto isScene = [&](ObjectId id) { return scene.objects[id.value].kind == "scene"; };
    for (std::uint32_t i = 0; i < scene.pairs.size() && !options_.collisions; ++i)
      if (isScene(scene.pairs[i].a) || isScene(scene.pairs[i].b))
        changes_.push_back({.kind = session::ChangeKind::kEnablePair, .index = i, .value = 0.0});
    for (const game_control::HandAssignment& take : options_.takes)
      changes_.push_back({.kind = session::ChangeKind::kTake, .hand = take.hand, .object = take.object});
  }

  void deliver(const session::OutgoingMessages& outgoing) {
    for (std::size_t i = 0; i < stations_.size(); ++i) {
      haptic::Station& station = *stations_[i];
      if (outgoing.events.step) station.receive(*outgoing.events.step);
      for (const CollisionMatrix& matrix : outgoing.events.matrix) station.receive(matrix);
      if (links_[i]) {
        links_[i]->send(outgoing, simulation_.now());
        continue;
      }
      for (const WorldFrame& frame : outgoing.frames) station.receive(frame);
      for (const HandManifold* manifold : outgoing.manifolds) station.receive(*manifold);
    }
    if (outgoing.events.run) reason_ = outgoing.events.run->reason;
    if (!options_.on_event) return;
    for (const EventLog& event : outgoing.events.log) options_.on_event(event);
  }

  RehearsalOptions options_;
  std::vector<std::unique_ptr<haptic::Station>> stations_;
  std::vector<std::unique_ptr<MeasuredLink>> links_;  ///< null: without
  std::vector<ClientId> clients_;                     ///< index as stations_
  session::SessionRegistry registry_;
  session::SessionSimulation simulation_;
  session::Publisher publisher_;
  std::vector<SceneObject> objects_;
  session::TickInput input_;
  Tick crowded_ticks_ = 0;
  session::TickOutput output_;
  std::string reason_;
  session::JournalEntry entry_;
  std::vector<session::Change> changes_;  ///< that no tick has had yet, the last one first
};

}  // namespace

Result<RehearsalReport> runRehearsal(const session::LoadedScene& loaded,
                                     std::vector<std::unique_ptr<haptic::Station>> stations,
                                     const RehearsalOptions& options) {
  return Rehearsal(loaded, std::move(stations), options).run();
}

}  // namespace tenon::rehearse
