#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>

#include "idl/types/ids.h"
#include "idl/types/messages.h"
#include "idl/types/result.h"
#include "idl/types/spatial.h"
#include "server/game_control/condition.h"
#include "server/simulation/scene.h"

namespace tenon {

/// One text in the languages of the scenario; the first is the scenario's main language.
using Texts = std::vector<LocalizedText>;

/// Where triangles come from: a part that the scenario's generator makes, or a file.
struct MeshSource {
  std::string part;            ///< the generator's name of it: `<part>.stl`, millimetres; empty for a file
  std::filesystem::path file;  ///< absolute, or relative to where the scenario was given; empty for a part
  double unit = 1e-3;          ///< [m] length of one file unit
};

/// How the haptic structures of an object are baked.
struct StructureSettings {
  double voxel = 0.003;                     ///< [m]
  std::int32_t refinement = 4;              ///< 1, 2, 4 or 8: of the boxes
  std::uint32_t points = 10'000;            ///< about how many shell points, when spacing is 0
  double spacing = 0.0;                     ///< [m]
  std::vector<Eigen::AlignedBox3d> refine;  ///< given by hand, in the object's frame
};

/// What makes an object a free body; what is not given follows from its volume.
struct ScenarioBody {
  std::optional<double> mass;        ///< [kg]; else by density
  double density = 0.0;              ///< [kg/m^3]
  std::optional<Vector3> p_OC_O;     ///< centre of mass
  std::optional<Vector3> inertia_C;  ///< [kg m^2] moments about it, along the object's axes
  bool floating = false;
  double damping = 0.0;  ///< [1/s]
  double friction = 0.4;
  int line = 0;
};

struct ScenarioObject {
  std::string name;
  Texts title;
  std::string kind = "part";
  std::string color = "#b0b7bf";
  std::uint32_t group = 0;  ///< number in ScenarioFile::groups, from 1; 0: none
  std::vector<MeshSource> meshes;
  bool felt = true;  ///< false: seen only, no structures
  StructureSettings structures;
  Pose X_WO;
  ObjectStatus status = ObjectStatus::kParked;
  double stiffness = 1000.0;  ///< [N/m]
  std::optional<ScenarioBody> body;
  int line = 0;
};

struct ScenarioHand {
  std::string name;
  Role role = Role::kTrainee;
  HandKind kind = HandKind::kCoupled;
  ObjectId object;
  double stiffness = 1000.0;
  double rotational_stiffness = 20.0;
  int line = 0;
};

/// Two objects that may touch. Which one is the shell follows from sizes, known only after baking.
struct ScenarioPair {
  ObjectId a;
  ObjectId b;
  double clearance = 0.0;          ///< [m] between the two when mounted, both sides together; 0: not said
  std::optional<double> dilation;  ///< [m] none: chosen by dilationOf
  bool sensing = false;
  bool enabled = true;
  std::optional<Friction> friction;  ///< none: that of the bodies
  int line = 0;                      ///< 0: listed automatically
};

enum class PlacementKind : std::uint8_t {
  kShow,  ///< parked at `X_WO`, or where it is; a free body falls from there
  kHide,
  kFix,   ///< the paper's fixedPose
  kFree,  ///< may be taken again, stays where it is
};

/// What a state does to an object when it begins.
struct Placement {
  PlacementKind kind = PlacementKind::kShow;
  ObjectId object;
  std::optional<Pose> X_WO;
};

struct HandAssignment {
  HandId hand;
  ObjectId object;
};

struct PairSwitch {
  std::uint32_t pair = 0;  ///< index into ScenarioFile::pairs
  bool enabled = true;
};

/// Objects of one group never touch.
struct GroupChange {
  ObjectId object;
  std::uint32_t group = 0;  ///< as in ScenarioObject
  int line = 0;
};

inline constexpr std::size_t kMostHelpers = 4;  ///< `may_take` of a state

enum class TimeoutAction : std::uint8_t { kFail, kSkip };

/// One state of the array of paper Fig. 4.
struct ScenarioState {
  std::string name;
  Texts title;
  Texts instruction;
  std::string part;  ///< title of the part this belongs to, for grouping
  // effects at its beginning, in this order
  std::vector<PairSwitch> pairs;
  std::vector<GroupChange> groups;
  std::vector<Placement> placements;
  std::vector<HandAssignment> hands;  ///< the paper's hdIndex: who moves what from this state on
  /// Hands that may take hold of a part as well for the time of this state, by touching it as one takes it.
  std::vector<HandAssignment> may_take;
  // what is asked
  ObjectId object;
  HandId hand;
  ObjectId touch;
  std::optional<Pose> X_WG;
  double tolerance = 0.002;
  double angle_tolerance = 0.0349066;  ///< 2 degrees
  Vector3 approach_W = Vector3::Zero();
  double approach_distance = 0.0;
  std::vector<Condition> conditions;
  // at its end
  bool snap = false;          ///< `object` is fixed at its target, the hand moves its own object again
  std::uint32_t timeout = 0;  ///< [ticks], 0: none
  TimeoutAction on_timeout = TimeoutAction::kFail;
  int line = 0;
};

/// A training scenario, read from YAML and checked: every reference in it is an index that exists.
///
/// Threads: constant once read. Real-time: reading its members.
struct ScenarioFile {
  std::filesystem::path path;   ///< of the YAML file
  std::uint64_t text_hash = 0;  ///< of the text it was read from
  std::string name;             ///< of its folder: what the part generator calls it
  std::string language = "en";
  Texts title;
  Vector3 gravity_W{0.0, 0.0, -9.81};   ///< [m/s^2]
  double reach = 10.0;                  ///< [m] no pose may be farther from the world's origin
  std::vector<ScenarioObject> objects;  ///< index = ObjectId
  std::vector<ScenarioHand> hands;      ///< index = HandId
  std::vector<ScenarioPair> pairs;      ///< index as in Scene::pairs
  std::vector<std::string> groups;      ///< their names, in order of first use
  std::vector<std::string> signals;     ///< names of external signals, in order of first use
  std::vector<ScenarioState> states;

  [[nodiscard]] ObjectId objectNamed(std::string_view object) const;  ///< invalid when there is none
  [[nodiscard]] HandId handNamed(std::string_view hand) const;
  [[nodiscard]] int pairOf(ObjectId a, ObjectId b) const;  ///< -1: they never touch
  /// -1 when no condition waits for it.
  [[nodiscard]] int signalNamed(std::string_view signal) const;
};

/// Reads a scenario file, or `scenario.yaml` in a folder. Fails with `file:line: what was wrong, what was
/// expected`.
[[nodiscard]] Result<ScenarioFile> readScenario(const std::filesystem::path& path);

/// The same from a text; `path` names it in errors and is the place that mesh files are relative to.
[[nodiscard]] Result<ScenarioFile> parseScenario(std::string_view text, const std::filesystem::path& path);

/// The order in which objects are baked so that refineBoxes() knows the parts that are mounted into each.
[[nodiscard]] std::vector<ObjectId> bakeOrder(const ScenarioFile& scenario);

/// Boxes in `object`'s own frame whose surface needs the finer voxels: the given ones, and around every
/// target of a part with a clearance to it that no given box touches (the part's box, swept back along its
/// approach). `structures` by ObjectId; a part not baked yet (null) adds nothing.
[[nodiscard]] std::vector<Eigen::AlignedBox3d> refineBoxes(
    const ScenarioFile& scenario, ObjectId object,
    const std::vector<std::shared_ptr<const HapticStructures>>& structures);

/// The side of a pair with a clearance that a part with a target goes into; invalid when targets do not tell,
/// then the larger object is the field.
[[nodiscard]] ObjectId fieldByTarget(const ScenarioFile& scenario, const ScenarioPair& pair);

/// The dilation of `field`'s surface in a pair (DESIGN section 2): at least 0.87 of the voxel that answers
/// there and at most a quarter of the clearance. Fails when both cannot hold.
[[nodiscard]] Result<double> dilationOf(const ScenarioFile& scenario, const ScenarioPair& pair,
                                        ObjectId field);

/// The mass of a free body, and how it is spread. Fails when the object encloses no volume to reckon with.
[[nodiscard]] Result<BodySpec> bodyOf(const ScenarioObject& object, const HapticStructures& structures);

/// The read-only scene. `structures` by ObjectId; null for an object that is only seen.
[[nodiscard]] Result<std::shared_ptr<const Scene>> makeScene(
    const ScenarioFile& scenario, std::vector<std::shared_ptr<const HapticStructures>> structures);

}  // namespace tenon
