#include "server/simulation/scene.h"

#include <algorithm>
#include <string_view>

namespace tenon::simulation {
namespace {

template <typename IdType, typename List>
IdType findNamed(const List& list, std::string_view name) {
  const auto found =
      std::find_if(list.begin(), list.end(), [&](const auto& one) { return one.name == name; });
  if (found == list.end()) return {};
  return {static_cast<std::uint32_t>(found - list.begin())};
}

}  // namespace

BoundingSphere boundingSphereOf(const structures::HapticStructures* structures) {
  if (structures == nullptr) return {};
  const structures::Pointshell& shell = structures->shell;
  if (!shell.empty()) {
    BoundingSphere sphere{shell.boundingCentre(), shell.boundingRadius()};
    for (const structures::ShellPoint& point : structures->features.points().points())
      sphere.radius = std::max(sphere.radius, (point.p_MP.cast<double>() - sphere.p_OQ_O).norm());
    return sphere;
  }
  if (structures->field.empty()) return {};
  const Eigen::AlignedBox3d box = structures->field.box();
  return {box.center(), 0.5 * box.diagonal().norm()};
}

ObjectId Scene::objectNamed(std::string_view name) const { return findNamed<ObjectId>(objects, name); }

HandId Scene::handNamed(std::string_view name) const { return findNamed<HandId>(hands, name); }

int Scene::pairOf(ObjectId a, ObjectId b) const {
  const auto found = std::find_if(pairs.begin(), pairs.end(), [&](const PairSpec& pair) {
    return (pair.a == a && pair.b == b) || (pair.a == b && pair.b == a);
  });
  return found == pairs.end() ? -1 : static_cast<int>(found - pairs.begin());
}

}  // namespace tenon::simulation
