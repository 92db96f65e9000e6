#include "server/simulation/engine.h"

#include <algorithm>
#include <utility>

namespace tenon::simulation {
namespace {

/// SQP steps per tick of an island without free bodies, at most: enough to reach a surface, slide along it
/// and reach a second one.
constexpr std::uint32_t kMaxHeldSteps = 4;

/// [m/s] kMaxHeldSteps steps of SolveLimits::max_step_length give this speed, at which a held body slides
/// along others.
constexpr double kSlidingSpeed = 1.0;

/// Work of an island in a tick (collision::SolveLimits::work), about 2.6 ms. In dense contact, as of gears
/// over their shaft, a step takes half of it; peg in hole, stacked bodies and engine bay stay below.
constexpr std::uint64_t kIslandWork = 80'000;

std::size_t listCount(const Scene& scene, const EnvironmentOptions& options) {
  return std::min(scene.pairs.size(), options.contact_lists);
}

/// [m] Lower bound of the radius that scales rotations: objects without structures have a radius of 0.
constexpr double kMinRadius = 0.01;

/// The limits with SQP steps so short that all of a tick together keep to `max_speed` [m/s] and
/// kSlidingSpeed.
collision::SolveLimits cappedLimits(collision::SolveLimits limits, double max_speed) {
  const double travel = std::min(max_speed, kSlidingSpeed) * kTickSeconds;
  limits.max_steps = std::clamp(limits.max_steps, 1U, kMaxHeldSteps);
  limits.max_step_length = std::min(limits.max_step_length, travel / limits.max_steps);
  limits.work = std::min(limits.work, kIslandWork);
  return limits;
}

/// Most objects that can be movable at a time: one per coupled hand, and all with a mass.
std::size_t maxMovable(const Scene& scene) {
  const auto hands = std::count_if(scene.hands.begin(), scene.hands.end(),
                                   [](const HandSpec& hand) { return hand.kind == HandKind::kCoupled; });
  const auto bodies = std::count_if(scene.objects.begin(), scene.objects.end(),
                                    [](const ObjectSpec& object) { return object.body.has_value(); });
  return static_cast<std::size_t>(hands + bodies);
}

ObjectSize sizeOf(const ObjectSpec& spec) {
  const BoundingSphere sphere = boundingSphereOf(spec.structures.get());
  return {sphere.p_OQ_O, sphere.radius, std::max(kMinRadius, sphere.radius)};
}

}  // namespace

Environment::Engine::Engine(const Scene& scene, const EnvironmentOptions& options)
    : contact_lists(listCount(scene, options)),
      path_lengths(scene.objects.size(), 0.0),
      pair_cells(scene.objects.size(), 0),
      hand_count(scene.hands.size()),
      limits(cappedLimits(options.limits, options.max_speed)),
      is_switched(scene.pairs.size(), 0),
      epochs(scene.objects.size(), 0),
      broad_phase(scene),
      touching(contact_lists.size()),
      budget(scene, contact_lists.size()),
      queried(scene.pairs.size(), 0),
      movable(scene.objects.size(), 0),
      solved(scene.objects.size(), 0),
      has_contact(scene.objects.size(), 0),
      reach(scene.objects.size(), 0.0),
      hidden(scene.objects.size(), 0),
      partition(scene.objects.size()),
      islands(maxMovable(scene), listCount(scene, options), std::max(options.workers, 1U)),
      feature_scratch(std::max(options.workers, 1U)),
      pool(options.workers) {
  max_margin = limits.contact_margin + kMaxLookAhead + 2.0 * limits.max_step_length;
  pairs.reserve(scene.pairs.size());
  near.reserve(scene.pairs.size());
  switched.reserve(scene.pairs.size());
  separated.reserve(scene.pairs.size());
  due.reserve(contact_lists.size());
  non_island.reserve(contact_lists.size());
  neighbours.reserve(scene.pairs.size());
  // a body has about as many contacts with a force as degrees of freedom; more contacts get no friction
  constexpr std::size_t kFrictionContactsPerObject = 16;
  friction_contacts.reserve(kFrictionContactsPerObject * scene.objects.size());
  for (std::size_t pair = 0; pair < scene.pairs.size(); ++pair) {
    pairs.emplace_back(scene, pair);
    cell_in_a.push_back(pair_cells[scene.pairs[pair].a.value]++);
    cell_in_b.push_back(pair_cells[scene.pairs[pair].b.value]++);
  }
  enabled_bits.assign((pairs.size() + 63) / 64, 0);
  for (std::size_t pair = 0; pair < pairs.size(); ++pair) setEnabled(pair, pairs[pair].enabled());
  incident_begin.push_back(0);
  for (const std::size_t count : pair_cells) incident_begin.push_back(incident_begin.back() + count);
  incident_pairs.resize(incident_begin.back());
  for (std::size_t pair = 0; pair < scene.pairs.size(); ++pair) {
    for (const auto& [object, cell] :
         {std::pair(scene.pairs[pair].a, cell_in_a[pair]), std::pair(scene.pairs[pair].b, cell_in_b[pair])}) {
      incident_pairs[incident_begin[object.value] + cell] = static_cast<std::uint32_t>(pair);
    }
  }
  for (const ObjectSpec& object : scene.objects) groups.push_back(object.group);
  for (std::size_t object = 0; object < scene.objects.size(); ++object) {
    forces.emplace_back(pair_cells[object] + scene.hands.size() + 1);
    sizes.push_back(sizeOf(scene.objects[object]));
    const std::optional<BodySpec>& body = scene.objects[object].body;
    bodies.emplace_back();
    if (body) bodies.back().emplace(FreeBody{RigidBody(*body, scene.gravity_W), {}});
  }
}

bool Environment::Engine::countsAsActive(std::size_t pair) const noexcept {
  const CollPair& one = pairs[pair];
  return one.enabled() && one.possible() && !inOneGroup(pair) && hidden[one.spec().a.value] == 0 &&
         hidden[one.spec().b.value] == 0;
}

void Environment::Engine::setEnabled(std::size_t pair, bool enabled) noexcept {
  pairs[pair].setEnabled(enabled);
  const std::uint64_t bit = std::uint64_t{1} << pair % 64;
  enabled_bits[pair / 64] = enabled ? enabled_bits[pair / 64] | bit : enabled_bits[pair / 64] & ~bit;
}

void Environment::Engine::resetWorkspace() noexcept {
  std::fill(queried.begin(), queried.end(), std::uint8_t{0});
  switched.clear();
  std::fill(is_switched.begin(), is_switched.end(), std::uint8_t{0});
  separated.clear();
  due.clear();
  non_island.clear();
  without_list = 0;
  recount = true;
  islands.clear();
}

}  // namespace tenon::simulation
