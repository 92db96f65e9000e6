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
#include "idl/types/messages/objects.h"
#include "idl/types/messages/role.h"
#include "idl/types/messages/steps.h"
#include "idl/types/result.h"
#include "idl/types/spatial.h"
#include "server/game_control/condition.h"
#include "server/simulation/scene.h"

namespace tenon::game_control {

/// One text in the languages of the scenario; the first is the scenario's main language.
using Texts = std::vector<LocalizedText>;

enum class ShapeKind : std::uint8_t { kBox, kSphere, kCylinder };

/// A simple solid, centred on the origin of its frame P; a cylinder's axis is z.
struct Shape {
  ShapeKind kind = ShapeKind::kBox;
  Vector3 size_P = Vector3::Zero();  ///< [m] along x, y and z
  double deviation = 0.0;            ///< [m] of facets from a round surface, at most; a box has none
  Pose X_OP;                         ///< in the frame of the object
};

/// A triangle mesh of an object: a part made by a generator, a file, or a shape. One of the three is given.
struct MeshSource {
  std::string part;  ///< name of the generated part: `<part>.stl`, in millimetres
  /// Absolute, or relative to the working directory as the scenario's path is.
  std::filesystem::path file;
  double unit = 1e-3;  ///< [m] length of one unit of the file
  std::optional<Shape> shape;
  int line = 0;
};

/// Settings for baking the haptic structures of an object.
struct StructureSettings {
  double voxel = 0.003;                     ///< [m] edge
  std::int32_t refinement = 4;              ///< 1, 2, 4 or 8: voxel / refinement is the edge in refined boxes
  std::uint32_t points = 10'000;            ///< approximate number of surface points, used when spacing is 0
  double spacing = 0.0;                     ///< [m] between surface points
  std::vector<Eigen::AlignedBox3d> refine;  ///< refined boxes from the file, in the object's frame
};

/// Mass properties of a dynamic object; what is not given follows from the volume its field encloses.
struct ScenarioBody {
  std::optional<double> mass;        ///< [kg] none: from the density
  double density = 0.0;              ///< [kg/m^3]
  std::optional<Vector3> p_OC_O;     ///< centre of mass
  std::optional<Vector3> inertia_C;  ///< [kg m^2] moments about C, along the object's axes
  bool floating = false;             ///< gravity does not act on it
  double damping = 0.0;              ///< [1/s] decay rate of its linear and angular velocity
  double friction = 0.4;             ///< [-] Coulomb coefficient while it moves freely
  int line = 0;                      ///< in the file, as everywhere here
};

struct ScenarioObject {
  std::string name;
  Texts title;
  std::string kind = "part";
  std::string color = "#b0b7bf";
  std::uint32_t group = 0;  ///< number in ScenarioFile::groups, from 1; 0: none
  std::vector<MeshSource> meshes;
  bool collidable = true;  ///< false: it is displayed only, and has no haptic structures
  StructureSettings structures;
  Pose X_WO;                                    ///< at the start
  ObjectStatus status = ObjectStatus::kParked;  ///< at the start
  double stiffness = 1000.0;                    ///< [N/m] of its penalty force
  std::optional<ScenarioBody> body;             ///< none: not dynamic
  int line = 0;
};

struct ScenarioHand {
  std::string name;
  Role role = Role::kTrainee;
  simulation::HandKind kind = simulation::HandKind::kCoupled;
  ObjectId object;         ///< default object: moved while the hand holds no other (pointer, forearm)
  double stiffness = 0.0;  ///< [N/m] of its coupling at most; 0: as its device and link allow
  double rotational_stiffness = 0.0;  ///< [Nm/rad] likewise
  int line = 0;
};

/// A collision pair. Which object is the pointshell side depends on targets, kinds and sizes, and sizes are
/// known only after baking: see makeScene().
struct ScenarioPair {
  ObjectId a;
  ObjectId b;
  double clearance = 0.0;  ///< [m] play between the two when mounted, sum of both sides; 0: not given
  bool sensing = false;    ///< contacts are displayed as vibration only and constrain nothing
  bool enabled = true;     ///< at the start
  std::optional<collision::Friction> friction;  ///< none: that of the bodies
  int line = 0;                                 ///< 0: listed automatically
};

enum class PlacementKind : std::uint8_t {
  kShow,  ///< visible at `X_WO`, or where it is: a dynamic object is free, any other parked
  kHide,
  kFix,   ///< fixed (the paper's fixedPose)
  kFree,  ///< no longer held or fixed; stays where it is, and may be grabbed
};

/// What a state does to an object when it begins.
struct Placement {
  PlacementKind kind = PlacementKind::kShow;
  ObjectId object;
  std::optional<Pose> X_WO;  ///< none: where it is
};

struct HandAssignment {
  HandId hand;
  ObjectId object;
};

struct PairSwitch {
  std::uint32_t pair = 0;  ///< index into ScenarioFile::pairs
  bool enabled = true;
};

/// Puts an object into a group. Objects of one group never collide.
struct GroupChange {
  ObjectId object;
  std::uint32_t group = 0;  ///< as in ScenarioObject
  int line = 0;
};

inline constexpr std::size_t kMaxStates = 256;
inline constexpr std::size_t kMaxHelpers = 4;  ///< entries in `may_take` of a state

enum class TimeoutAction : std::uint8_t { kFail, kSkip };

/// One state of the task state machine (the array of paper Fig. 4).
struct ScenarioState {
  std::string name;
  Texts title;
  Texts instruction;
  std::string part;  ///< title of the part it belongs to, by which displays group states
  // effects at its beginning, in this order
  std::vector<PairSwitch> pairs;
  std::vector<GroupChange> groups;
  std::vector<Placement> placements;
  std::vector<HandAssignment> hands;  ///< which hand moves which object from this state on (paper: hdIndex)
  /// Helping hands: while this state lasts, each may grab its object as well by touching it for a second.
  std::vector<HandAssignment> may_take;
  // the task
  ObjectId object;
  HandId hand;
  ObjectId touch;                        ///< the object to touch; invalid: none
  std::optional<Pose> X_WG;              ///< target pose of `object`
  double tolerance = 0.002;              ///< [m] of the centre's position at the target
  double angle_tolerance = 0.0349066;    ///< [rad] of the target orientation: 2 degrees
  Vector3 approach_W = Vector3::Zero();  ///< unit vector of the motion towards the target; zero: any
  double approach_distance = 0.0;        ///< [m] before the target, from which on the direction matters
  std::vector<Condition> conditions;     ///< tree; the state ends when its root is met
  // at its end
  /// `object` is fixed at its target, and hands that held it move their default objects again
  bool snap = false;
  std::uint32_t timeout = 0;  ///< [ticks] 0: none
  TimeoutAction on_timeout = TimeoutAction::kFail;
  int line = 0;  ///< 0: not in the file, see ReadOptions::needs_states
};

/// A training scenario, read from YAML and checked: all ids and indices in it are valid.
///
/// Threads: constant once read. Real-time: reading its members.
struct ScenarioFile {
  std::filesystem::path path;   ///< of the YAML file
  std::uint64_t text_hash = 0;  ///< of the text it was read from
  std::string name;             ///< of its folder
  std::string part_set;         ///< set of generated parts that its meshes name; empty: not given
  int part_set_line = 0;
  std::string language = "en";  ///< main language
  Texts title;
  Vector3 gravity_W{0.0, 0.0, -9.81};  ///< [m/s^2]
  double reach = 10.0;                 ///< [m] largest distance of an object's centre from the world's origin
  std::vector<ScenarioObject> objects;  ///< index = ObjectId
  std::vector<ScenarioHand> hands;      ///< index = HandId
  std::vector<ScenarioPair> pairs;      ///< index as in Scene::pairs
  std::vector<std::string> groups;      ///< their names, in order of first use
  std::vector<std::string> signals;     ///< names of external signals, in order of first use
  std::vector<ScenarioState> states;

  [[nodiscard]] ObjectId objectNamed(std::string_view object) const;  ///< invalid when there is none
  [[nodiscard]] HandId handNamed(std::string_view hand) const;        ///< invalid when there is none
  /// Index of the pair of two objects, in either order; -1 when they never collide.
  [[nodiscard]] int pairOf(ObjectId a, ObjectId b) const;
  /// Index into `signals`; -1 when no condition uses it.
  [[nodiscard]] int signalNamed(std::string_view signal) const;
};

/// How a scenario is read where its hands follow files instead of people.
struct ReadOptions {
  /// Hands that hold an object from the start on: it counts as moved by that hand, so it has pairs. Ids that
  /// the scenario does not have are ignored.
  std::vector<HandAssignment> taken;
  /// False: a file without states gets one, with line 0, that lasts until somebody sends kFulfilled.
  bool needs_states = true;
  bool only_names = false;  ///< stop after objects and hands: to look up their ids for `taken`
};

/// Reads a scenario file, or `scenario.yaml` in a folder; a name without a folder may be that of a shipped
/// scenario, in the folder that TENON_SHARE names. Fails with `file:line: what was wrong, what was
/// expected`.
[[nodiscard]] Result<ScenarioFile> readScenario(const std::filesystem::path& path,
                                                const ReadOptions& options = {});

/// As readScenario(), from a text. `path` names it in errors; mesh files are relative to its folder.
[[nodiscard]] Result<ScenarioFile> parseScenario(std::string_view text, const std::filesystem::path& path,
                                                 const ReadOptions& options = {});

/// All objects in an order in which the parts that are mounted into an object are baked before it, as
/// refineBoxes() needs.
[[nodiscard]] std::vector<ObjectId> bakeOrder(const ScenarioFile& scenario);

/// Boxes in the frame of `object` that need the refined voxels: those given in the file, and one around each
/// target of a part that has a clearance to `object`, unless a given box intersects it (the part's bounding
/// box, swept back along the approach). `structures` by ObjectId; a part not baked yet (null) adds nothing.
[[nodiscard]] std::vector<Eigen::AlignedBox3d> refineBoxes(
    const ScenarioFile& scenario, ObjectId object,
    const std::vector<std::shared_ptr<const structures::HapticStructures>>& structures);

/// The SDF side of a pair with a clearance: the object that the other one, which has a target, is mounted
/// into; when both have targets, the one that is mounted first. Invalid when none has a target; then kinds
/// and sizes decide, see makeScene().
[[nodiscard]] ObjectId sdfSideByTarget(const ScenarioFile& scenario, const ScenarioPair& pair);

/// Fails, with file and line, when the pair's clearance is smaller than the field of its SDF side `field`
/// resolves where the part is mounted: a quarter of it, on each side, must be left of what thickens thin
/// walls there (see DistanceField::Layout::dilations), and of the error at the edges of solids. `structures`
/// by ObjectId.
[[nodiscard]] Result<void> checkClearance(
    const ScenarioFile& scenario, const ScenarioPair& pair, ObjectId field,
    const std::vector<std::shared_ptr<const structures::HapticStructures>>& structures);

/// Mass properties of an object that has a body. Fails when they have to follow from its volume and its field
/// encloses none, or when the given centre of mass is outside of the object.
[[nodiscard]] Result<simulation::BodySpec> bodyOf(const ScenarioObject& object,
                                                  const structures::HapticStructures& structures);

/// An object that the scenario puts where it cannot be.
struct Misplacement {
  ObjectId object;
  Vector3 p_WQ = Vector3::Zero();  ///< of its centre
  double distance = 0.0;           ///< [m] from the world's origin, or from the box of all objects
  int line = 0;
  std::string what;  ///< a sentence without file and line
};

/// Poses beyond `reach` of the world's origin, by the objects' centres, and targets far from all objects; in
/// the order of the file. `structures` by ObjectId, null where there are none.
[[nodiscard]] std::vector<Misplacement> misplacedObjects(
    const ScenarioFile& scenario,
    const std::vector<std::shared_ptr<const structures::HapticStructures>>& structures);

/// The read-only scene. `structures` by ObjectId; null for an object that is not collidable. SDF side of a
/// pair: by sdfSideByTarget(), else never a pointer or an assistant, else the larger object. Fails, with file
/// and line, when structures are missing, an object is out of reach, a target is far from all objects, a
/// clearance is too small for the voxels, or a body has no mass properties.
[[nodiscard]] Result<std::shared_ptr<const simulation::Scene>> makeScene(
    const ScenarioFile& scenario,
    std::vector<std::shared_ptr<const structures::HapticStructures>> structures);

}  // namespace tenon::game_control
