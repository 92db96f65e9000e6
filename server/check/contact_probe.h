#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/spatial.h"
#include "server/collision/feature_query.h"
#include "server/simulation/scene.h"

namespace tenon::check {

/// Which surface of the SDF side counts.
enum class ProbedSurface : std::uint8_t {
  kMesh,     ///< the mesh, as well as the voxels resolve it
  kContact,  ///< what a part meets in a session: outside of it by the dilation of thin walls
};

/// What a part may meet: another object at rest, and their pair in the Scene.
struct PartObstacle {
  ObjectId object;
  std::size_t pair = 0;
  Pose X_WO;
};

/// Where a part is nearest to an obstacle, or deepest inside.
struct NearestPlace {
  double gap = 0.0;                ///< [m] signed; a bound when it is not `exact`
  double free_path = 0.0;          ///< [m] of any point towards the obstacle: at most `gap`
  bool exact = false;              ///< the gap is within the band of the field
  bool located = false;            ///< there is a contact: its place, of the deepest one within the band
  Vector3 p_WP = Vector3::Zero();  ///< if located
  Vector3 n_W = Vector3::Zero();   ///< unit, from the obstacle into the part; if located
  double voxel = 0.0;              ///< [m] of the field there: its finest of all when not located
  double dilation = 0.0;           ///< [m] of the field there; if located
};

/// A motion of a part by the path length `s` [m] of its fastest point.
using PartMotion = std::function<Pose(double s)>;

/// How far a part can be moved.
struct PartTravel {
  double length = 0.0;   ///< [m] free path; the limit when nothing blocks it
  bool complete = true;  ///< false: steps ran out, and nothing is known beyond `length`
  bool blocked = false;  ///< by `obstacle` (an index), at `place`
  std::size_t obstacle = 0;
  NearestPlace place;
};

/// What is tolerated of the error of a field: `absolute` + `voxels` times the voxel.
struct ProbeTolerance {
  double absolute = 0.0;  ///< [m]
  double voxels = 0.0;    ///< [-]
  [[nodiscard]] double at(const NearestPlace& place) const { return absolute + voxels * place.voxel; }
};

/// Queries of one part against others that stand still, with the fields, pointshells and features of the
/// simulation: what holds a part in a session is found.
///
/// Threads: one. Real-time: no.
class ContactProbe {
 public:
  ContactProbe(const simulation::Scene& scene, ObjectId part);

  [[nodiscard]] NearestPlace nearest(const PartObstacle& obstacle, const Pose& X_WO, ProbedSurface surface);

  /// Moves the part until it is deeper in an obstacle than `floors` [m] (by obstacle, <= 0: a gap) by more
  /// than `tolerance`, or up to `limit` [m]. Steps are as long as the gap permits, and short where the part
  /// slides: features thinner than a quarter of a voxel may be passed.
  [[nodiscard]] PartTravel travel(std::span<const PartObstacle> obstacles, std::span<const double> floors,
                                  const PartMotion& motion, double limit, ProbedSurface surface,
                                  const ProbeTolerance& tolerance);

 private:
  /// The least room before a floor is passed.
  struct Room {
    double room = 0.0;       ///< [m] < 0: passed
    double free_path = 0.0;  ///< [m] before any obstacle is met
    std::size_t obstacle = 0;
    NearestPlace place;
  };
  /// `floors` [m]: as in travel().
  [[nodiscard]] Room roomAt(std::span<const PartObstacle> obstacles, std::span<const double> floors,
                            const Pose& X_WO, ProbedSurface surface, const ProbeTolerance& tolerance);

  const simulation::Scene& scene_;
  ObjectId part_;
  std::unique_ptr<collision::PairQueryResult> result_;
  std::unique_ptr<collision::FeatureScratch> feature_scratch_;
};

}  // namespace tenon::check
