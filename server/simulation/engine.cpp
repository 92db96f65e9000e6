#include "server/simulation/engine.h"

#include <algorithm>
#include <utility>

namespace tenon {
namespace {

/// A tick's travel is made in this many sub-steps: enough to meet a surface, turn along it and meet a second
/// one.
constexpr std::uint32_t kTravelSubsteps = 4;

std::size_t roomsFor(const Scene& scene, const EnvironmentOptions& options) {
  return std::min(scene.pairs.size(), options.rooms);
}

/// The least body radius that scales rotations [m]: an object without structures still turns with its hand.
constexpr double kLeastRadius = 0.01;

SolveLimits cappedLimits(SolveLimits limits, double max_speed) {
  const double travel = max_speed * kTickSeconds;
  limits.substeps = std::clamp(limits.substeps, 1U, kTravelSubsteps);
  limits.substep_travel = std::min(limits.substep_travel, travel / limits.substeps);
  return limits;
}

/// At most so many objects move at a time: what hands hold, and what has a mass.
std::size_t mostMovable(const Scene& scene) {
  const auto hands = std::count_if(scene.hands.begin(), scene.hands.end(),
                                   [](const HandSpec& hand) { return hand.kind == HandKind::kCoupled; });
  const auto bodies = std::count_if(scene.objects.begin(), scene.objects.end(),
                                    [](const ObjectSpec& object) { return object.body.has_value(); });
  return static_cast<std::size_t>(hands + bodies);
}

ObjectSize sizeOf(const ObjectSpec& spec) {
  ObjectSize size;
  size.radius = kLeastRadius;
  if (!spec.structures) return size;
  const Pointshell& shell = spec.structures->shell;
  if (!shell.empty()) {
    size.p_OC_O = shell.ballCentre();
    size.ball = shell.ballRadius();
    size.radius = std::max(size.radius, shell.radius());
  } else if (!spec.structures->field.empty()) {
    const Eigen::AlignedBox3d box = spec.structures->field.box();
    size.p_OC_O = box.center();
    size.ball = 0.5 * box.diagonal().norm();
    size.radius = std::max(size.radius, size.p_OC_O.norm() + size.ball);
  }
  return size;
}

}  // namespace

Environment::Engine::Engine(const Scene& scene, const EnvironmentOptions& options)
    : rooms(roomsFor(scene, options)),
      odometers(scene.objects.size(), 0.0),
      pair_cells(scene.objects.size(), 0),
      hand_count(scene.hands.size()),
      limits(cappedLimits(options.limits, options.max_speed)),
      broad_phase(scene),
      touching(rooms.size()),
      budget(scene, rooms.size()),
      looked_at(scene.pairs.size(), 0),
      movable(scene.objects.size(), 0),
      solved(scene.objects.size(), 0),
      at_rest(scene.objects.size(), 0),
      meets(scene.objects.size(), 0),
      hidden(scene.objects.size(), 0),
      partition(scene.objects.size()),
      islands(mostMovable(scene), roomsFor(scene, options), std::max(options.workers, 1U)),
      pool(options.workers) {
  reach = limits.contact_margin + kLookAheadReach + 2.0 * limits.substep_travel;
  pairs.reserve(scene.pairs.size());
  near.reserve(scene.pairs.size());
  left.reserve(scene.pairs.size());
  due.reserve(rooms.size());
  others.reserve(rooms.size());
  // a body's contacts that push are about as many as it has ways to move
  constexpr std::size_t kRubsPerObject = 16;
  rubs.reserve(kRubsPerObject * scene.objects.size());
  for (std::size_t pair = 0; pair < scene.pairs.size(); ++pair) {
    pairs.emplace_back(scene, pair);
    cell_in_a.push_back(pair_cells[scene.pairs[pair].a.value]++);
    cell_in_b.push_back(pair_cells[scene.pairs[pair].b.value]++);
  }
  switches.assign((pairs.size() + 63) / 64, 0);
  for (std::size_t pair = 0; pair < pairs.size(); ++pair) setEnabled(pair, pairs[pair].enabled());
  pairs_from.push_back(0);
  for (const std::size_t count : pair_cells) pairs_from.push_back(pairs_from.back() + count);
  pairs_of.resize(pairs_from.back());
  for (std::size_t pair = 0; pair < scene.pairs.size(); ++pair) {
    for (const auto& [object, cell] :
         {std::pair(scene.pairs[pair].a, cell_in_a[pair]), std::pair(scene.pairs[pair].b, cell_in_b[pair])}) {
      pairs_of[pairs_from[object.value] + cell] = static_cast<std::uint32_t>(pair);
    }
  }
  for (const ObjectSpec& object : scene.objects) groups.push_back(object.group);
  for (std::size_t object = 0; object < scene.objects.size(); ++object) {
    forces.emplace_back(pair_cells[object] + scene.hands.size() + 1, options.send_policy);
    sizes.push_back(sizeOf(scene.objects[object]));
    const std::optional<BodySpec>& body = scene.objects[object].body;
    bodies.emplace_back();
    if (body) bodies.back().emplace(FreeBody{RigidBody(*body, scene.gravity_W), {}});
  }
}

bool Environment::Engine::counts(std::size_t pair) const noexcept {
  const CollPair& one = pairs[pair];
  return one.enabled() && one.possible() && !grouped(pair) && hidden[one.spec().a.value] == 0 &&
         hidden[one.spec().b.value] == 0;
}

void Environment::Engine::setEnabled(std::size_t pair, bool enabled) noexcept {
  pairs[pair].setEnabled(enabled);
  const std::uint64_t bit = std::uint64_t{1} << pair % 64;
  switches[pair / 64] = enabled ? switches[pair / 64] | bit : switches[pair / 64] & ~bit;
}

void Environment::Engine::forgetTick() noexcept {
  std::fill(looked_at.begin(), looked_at.end(), std::uint8_t{0});
  left.clear();
  due.clear();
  others.clear();
  refused = 0;
  recount = true;
  islands.clear();
}

}  // namespace tenon
