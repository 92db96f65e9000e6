#include <algorithm>
#include <system_error>

#include "server/game_control/named_values.h"
#include "server/game_control/scenario_reader.h"

namespace tenon::game_control {
namespace {

constexpr NamedValues<double, 4> kUnits{{{"mm", 1e-3}, {"cm", 1e-2}, {"m", 1.0}, {"in", 0.0254}}};

constexpr double kLeastLength = 1e-4;    // [m] of a shape
constexpr double kLargestLength = 20.0;  // [m]

// Deviation of the facets of a round surface, in parts of its radius. The default is 0.05 mm, the usual
// choice for export from CAD, but at most 1 % of the radius (small parts stay round) and at least 0.01 %
// (50,000 triangles of a large sphere).
constexpr double kDefaultDeviation = 5e-5;  // [m]
constexpr double kLargestRelativeDefault = 0.01;
constexpr double kLeastRelativeDefault = 1e-4;
constexpr double kLeastRelativeDeviation = 1e-5;  // 600,000 triangles of a sphere
constexpr double kLargestRelativeDeviation = 0.2;

/// [m] of a round surface of `radius` [m] when none is given.
double defaultDeviation(double radius) {
  return std::clamp(kDefaultDeviation, kLeastRelativeDefault * radius, kLargestRelativeDefault * radius);
}

constexpr std::array<const char*, 5> kMeshKinds{"part", "file", "box", "sphere", "cylinder"};

}  // namespace

void ScenarioReader::readMeshes(const YAML::Node& node, ScenarioObject& object) {
  const std::string what = "'meshes' of object '" + object.name + "'";
  if (!node.IsDefined()) {
    yaml_.fail(node, what +
                         " is missing, expected a list such as [{file: peg.stl, unit: mm}] or "
                         "[{sphere: {diameter: 24 mm}}]");
  }
  if (yaml_.failed() || !yaml_.checkList(node, what)) return;
  if (node.size() == 0) yaml_.fail(node, what + " is empty, expected at least one mesh");
  for (const auto& entry : node) {
    if (yaml_.failed()) return;
    object.meshes.push_back(readMesh(entry, object.name));
  }
}

MeshSource ScenarioReader::readMesh(const YAML::Node& node, const std::string& object) {
  const std::string of = "of 'meshes' of object '" + object + "'";
  MeshSource mesh;
  mesh.line = yaml_.lineOf(node);
  if (!yaml_.openMapping(node, "mesh", "a mesh of object '" + object + "'")) return mesh;
  const auto given = std::count_if(kMeshKinds.begin(), kMeshKinds.end(),
                                   [&](const char* kind) { return node[kind].IsDefined(); });
  if (given != 1) {
    yaml_.fail(node, "a mesh of object '" + object + "' has " + (given == 0 ? "none" : "several") +
                         " of part, file, box, sphere and cylinder, expected one");
    return mesh;
  }
  const bool is_file = node["file"].IsDefined();
  if (node["unit"].IsDefined() && !is_file)
    yaml_.fail(node["unit"], "'unit' " + of + " is for files only, remove it");
  if (!is_file && !node["part"].IsDefined()) {
    mesh.shape = readShape(node, object);
    return mesh;
  }
  for (const char* key : {"at", "turn", "q"}) {
    if (node[key].IsDefined())
      yaml_.fail(node[key], "'" + std::string(key) + "' " + of +
                                " is for a box, a sphere or a cylinder only; a file or a part lies where its "
                                "coordinates say");
  }
  if (!is_file) {
    mesh.part = yaml_.text(node["part"], "'part' " + of);
    return mesh;
  }
  mesh.file = scenario_.path.parent_path() / yaml_.text(node["file"], "'file' " + of);
  mesh.unit = oneOf(yaml_, node["unit"], "'unit' " + of, kUnits, 1e-3);
  std::error_code problem;
  if (!std::filesystem::is_regular_file(mesh.file, problem))
    yaml_.fail(node["file"], "object '" + object + "' has no mesh file " + mesh.file.string());
  return mesh;
}

Shape ScenarioReader::readShape(const YAML::Node& node, const std::string& object) {
  const std::string object_text = "of object '" + object + "'";
  Shape shape;
  shape.X_OP = yaml_.pose(node, "a mesh " + object_text);
  if (const YAML::Node box = node["box"]; box.IsDefined()) {
    if (!box.IsSequence() || box.size() != 3) {
      yaml_.fail(box,
                 "'box' " + object_text +
                     " must be a list of its edge lengths along x, y and z, such as [20 mm, 30 mm, 40 mm]");
      return shape;
    }
    for (int i = 0; i < 3; ++i) {
      shape.size_P[i] = yaml_.number(box[i], Quantity::kLength, "an edge of 'box' " + object_text,
                                     kLeastLength, kLargestLength);
    }
    return shape;
  }
  const bool is_sphere = node["sphere"].IsDefined();
  const YAML::Node round = node[is_sphere ? "sphere" : "cylinder"];
  const std::string name = is_sphere ? "'sphere' " : "'cylinder' ";
  shape.kind = is_sphere ? ShapeKind::kSphere : ShapeKind::kCylinder;
  if (!round.IsMap()) {
    yaml_.fail(round, name + object_text + " must be a mapping such as " +
                          (is_sphere ? "{diameter: 24 mm}" : "{diameter: 10 mm, length: 40 mm}"));
    return shape;
  }
  if (!yaml_.openMapping(round, is_sphere ? "sphere" : "cylinder", name + object_text)) return shape;
  const YAML::Node radius_node = round["radius"];
  const YAML::Node diameter_node = round["diameter"];
  if (radius_node.IsDefined() == diameter_node.IsDefined()) {
    yaml_.fail(round, name + object_text + " needs either 'diameter' or 'radius'");
    return shape;
  }
  const double radius =
      radius_node.IsDefined()
          ? yaml_.number(radius_node, Quantity::kLength, "'radius' of " + name + object_text,
                         kLeastLength / 2, kLargestLength / 2)
          : yaml_.number(diameter_node, Quantity::kLength, "'diameter' of " + name + object_text,
                         kLeastLength, kLargestLength) /
                2;
  shape.size_P = Vector3::Constant(2.0 * radius);
  if (!is_sphere) {
    shape.size_P.z() = yaml_.number(round["length"], Quantity::kLength, "'length' of " + name + object_text,
                                    kLeastLength, kLargestLength);
  }
  shape.deviation = yaml_.numberOr(round["deviation"], Quantity::kLength,
                                   "'deviation' of " + name + object_text, kLeastRelativeDeviation * radius,
                                   kLargestRelativeDeviation * radius, defaultDeviation(radius));
  return shape;
}

}  // namespace tenon::game_control
