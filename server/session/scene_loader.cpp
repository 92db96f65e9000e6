#include "server/session/scene_loader.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "idl/record/compression.h"
#include "idl/types/hash.h"
#include "idl/wire/assets.h"
#include "server/bake/bake.h"
#include "server/bake/display_model.h"
#include "server/bake/shapes.h"
#include "server/game_control/quantity_text.h"
#include "server/session/generated_parts.h"
#include "server/simulation/compiled_scene.h"
#include "server/structures/gap_note.h"

namespace tenon::session {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kModelKey = R"("model":")";
constexpr std::size_t kAssetNameLength = 30;

/// Mesh files of an object, all in one unit.
struct ObjectMeshes {
  std::vector<fs::path> files;
  double unit = 1e-3;  ///< [m] length of one unit of the files
};

bake::TriangleMesh meshOf(const game_control::Shape& shape) {
  const Vector3& size_P = shape.size_P;
  bake::TriangleMesh mesh;
  switch (shape.kind) {
    case game_control::ShapeKind::kBox:
      mesh = bake::makeBox(size_P);
      break;
    case game_control::ShapeKind::kSphere:
      mesh = bake::makeSphere(size_P.x() / 2, shape.deviation);
      break;
    case game_control::ShapeKind::kCylinder:
      mesh = bake::makeCylinder(size_P.x() / 2, size_P.z(), shape.deviation);
      break;
  }
  for (Vector3f& p : mesh.vertices) p = (shape.X_OP * p.cast<double>()).cast<float>();
  return mesh;
}

/// The file of a shape below the folder `cache`, in a unit of `unit` [m]. Its name follows from the shape,
/// and its contents are part of the key of the structures, as those of any mesh are. It is always written: a
/// damaged one does not stay.
Result<fs::path> shapeFile(const game_control::Shape& shape, double unit, const fs::path& cache) {
  constexpr std::array<const char*, 3> kNames{"box", "sphere", "cylinder"};
  StateHash hash;
  hash.add(shape.size_P);
  hash.add(shape.deviation);
  hash.add(shape.X_OP);
  hash.add(unit);
  const fs::path file =
      cache / "shapes" /
      fmt::format("{}_{:016x}.stl", kNames[static_cast<std::size_t>(shape.kind)], hash.value());
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  if (error)
    return fail(
        fmt::format("{}: cannot make this folder ({})", file.parent_path().string(), error.message()));
  if (const auto written = bake::writeStl(file, meshOf(shape), unit); !written)
    return fail(written.error().what);
  return file;
}

/// `parts` is the folder of the generated parts. Fails when the units of the files differ; a shape takes that
/// of the others.
Result<ObjectMeshes> meshesOf(const game_control::ScenarioFile& scenario,
                              const game_control::ScenarioObject& object, const fs::path& parts,
                              const LoadOptions& options) {
  ObjectMeshes meshes;
  const auto isFile = [](const game_control::MeshSource& mesh) { return !mesh.shape; };
  const auto first_file = std::find_if(object.meshes.begin(), object.meshes.end(), isFile);
  if (first_file != object.meshes.end()) meshes.unit = first_file->unit;
  for (const game_control::MeshSource& mesh : object.meshes) {
    if (mesh.shape) {
      auto file = shapeFile(*mesh.shape, meshes.unit, options.cache);
      if (!file) return fail(file.error().what);
      meshes.files.push_back(std::move(*file));
      continue;
    }
    if (mesh.unit != meshes.unit)
      return fail(fmt::format("{}:{}: the meshes of '{}' have different units", scenario.path.string(),
                              mesh.line, object.name));
    meshes.files.push_back(mesh.part.empty() ? mesh.file : parts / (mesh.part + ".stl"));
  }
  return meshes;
}

Result<std::shared_ptr<const structures::HapticStructures>> structuresOf(
    const game_control::ScenarioFile& scenario, ObjectId id, const fs::path& parts,
    const LoadOptions& options, const LoadProgress& progress,
    const std::vector<std::shared_ptr<const structures::HapticStructures>>& others) {
  const game_control::ScenarioObject& object = scenario.objects[id.value];
  const auto meshes = meshesOf(scenario, object, parts, options);
  if (!meshes) return fail(meshes.error().what);
  bake::BakeOptions bake;
  bake.voxel = object.structures.voxel;
  bake.refinement = object.structures.refinement;
  bake.points = object.structures.points;
  bake.point_spacing = object.structures.spacing;
  for (const Eigen::AlignedBox3d& box : game_control::refineBoxes(scenario, id, others))
    bake.refine.push_back({box});
  const auto report = [&](double fraction, std::string_view activity) {
    if (progress) progress(fmt::format("{}: {}", object.title.front().text, activity), fraction);
    return !options.isStopped();
  };
  const auto file = bake::bakeCached(meshes->files, meshes->unit, bake, options.cache / "structures", report);
  if (!file)
    return fail(
        fmt::format("{}:{}: '{}': {}", scenario.path.string(), object.line, object.name, file.error().what));
  return structures::openStructures(*file);
}

/// 0xRRGGBB of an object's colour, which is `#rrggbb` or `#rrggbbaa`.
std::uint32_t colorNumber(const std::string& color) {
  return static_cast<std::uint32_t>(std::stoul(color.substr(1, 6), nullptr, 16));
}

/// The levels of one object as JSON; an empty list when its meshes cannot be read. What was made is noted in
/// a file named by displayKey.
Result<std::string> displayLevels(const ObjectMeshes& meshes, std::uint32_t uncolored,
                                  const wire::AssetStore& store, const LoadOptions& options) {
  const fs::path notes = options.cache / "display";
  const auto key = bake::displayKey(meshes.files, meshes.unit, uncolored);
  if (!key) return std::string("[]");
  std::ifstream noted(notes / *key);
  std::string text;
  bool is_whole = std::getline(noted, text) && !noted.eof();  // a whole note ends with a newline
  // every asset that the note names is there
  for (std::size_t at = text.find(kModelKey); at != std::string::npos; at = text.find(kModelKey, at + 1))
    is_whole = is_whole && store.has(text.substr(at + kModelKey.size(), kAssetNameLength));
  if (is_whole) return text;

  const auto goOn = [&options](double, std::string_view) { return !options.isStopped(); };
  const auto models = bake::displayModelsOf(meshes.files, meshes.unit, uncolored, goOn);
  if (options.isStopped()) return fail("stopped");
  if (!models) return std::string("[]");
  text.clear();
  for (const bake::DisplayModel& model : *models) {
    const auto asset = store.put(model.glb);
    if (!asset) return asset;
    text += fmt::format(R"({}{{{}{}","triangles":{},"error":{:.3g}}})", text.empty() ? "" : ",", kModelKey,
                        *asset, model.triangles, model.error);
  }
  text = "[" + text + "]";
  std::error_code error;
  fs::create_directories(notes, error);
  std::ofstream(notes / *key) << text << "\n";
  return text;
}

/// The name of the asset.
Result<std::string> compiledScene(const simulation::Scene& scene, const wire::AssetStore& store) {
  const auto bytes = simulation::sceneBytes(scene);
  if (!bytes) return fail(bytes.error().what);
  const auto packed = record::compress(*bytes);
  if (!packed) return fail("the compiled scene: " + packed.error().what);
  return store.put(*packed);
}

}  // namespace

Result<LoadedScene> loadScene(const fs::path& path, const LoadOptions& options,
                              const LoadProgress& progress) {
  auto file = game_control::readScenario(path, options.read);
  if (!file) return fail(file.error().what);
  auto loaded =
      loadStructures(std::make_shared<const game_control::ScenarioFile>(std::move(*file)), options, progress);
  if (!loaded) return fail(loaded.error().what);
  auto scene = game_control::makeScene(*loaded->scenario, std::move(loaded->structures));
  if (!scene) return fail(scene.error().what);
  return LoadedScene{loaded->scenario, std::move(*scene)};
}

Result<LoadedStructures> loadStructures(std::shared_ptr<const game_control::ScenarioFile> scenario,
                                        const LoadOptions& options, const LoadProgress& progress) {
  const auto parts = generatedParts(
      *scenario, options.cache, options.detail,
      [&] {
        if (progress) progress("generating the parts", 0.0);
      },
      options.stop);
  if (!parts) return fail(parts.error().what);
  std::vector<std::shared_ptr<const structures::HapticStructures>> structures(scenario->objects.size());
  for (const ObjectId id : game_control::bakeOrder(*scenario)) {
    if (!scenario->objects[id.value].collidable) continue;
    auto baked = structuresOf(*scenario, id, *parts, options, progress, structures);
    if (!baked) return fail(baked.error().what);
    structures[id.value] = std::move(*baked);
  }
  return LoadedStructures{std::move(scenario), std::move(structures)};
}

std::vector<Eigen::AlignedBox3d> meshBoxes(const game_control::ScenarioFile& scenario,
                                           const LoadOptions& options) {
  std::vector<Eigen::AlignedBox3d> boxes_O(scenario.objects.size());
  const auto parts = generatedParts(scenario, options.cache, options.detail);
  if (!parts) return boxes_O;
  for (std::size_t i = 0; i < boxes_O.size(); ++i) {
    const auto meshes = meshesOf(scenario, scenario.objects[i], *parts, options);
    if (!meshes) continue;
    for (const fs::path& file : meshes->files)
      if (const auto mesh = bake::importMesh(file, meshes->unit))
        for (const Vector3f& p : mesh->vertices) boxes_O[i].extend(p.cast<double>());
  }
  return boxes_O;
}

Fingerprint fingerprintOf(const LoadedScene& loaded) {
  Fingerprint fingerprint{fmt::format("{:016x}", loaded.scenario->text_hash), {}};
  for (const simulation::ObjectSpec& object : loaded.scene->objects)
    if (object.structures != nullptr)
      fingerprint.structures[object.name] = object.structures->info.content_hash;
  return fingerprint;
}

std::vector<std::string> changesSince(const Fingerprint& then, const LoadedScene& loaded) {
  const Fingerprint now = fingerprintOf(loaded);
  std::vector<std::string> changes;
  if (!then.scenario.empty() && then.scenario != now.scenario)
    changes.push_back(fmt::format("the text of {}", loaded.scenario->path.string()));
  for (const auto& [object, hash] : then.structures) {
    const auto found = now.structures.find(object);
    if (found == now.structures.end()) {
      changes.push_back(fmt::format("'{}' was removed", object));
    } else if (found->second != hash) {
      changes.push_back(fmt::format("the structures of '{}'", object));
    }
  }
  if (!then.structures.empty())
    for (const auto& [object, hash] : now.structures)
      if (!then.structures.contains(object)) changes.push_back(fmt::format("'{}' was added", object));
  return changes;
}

std::vector<std::string> thinWallReport(const simulation::Scene& scene) {
  std::vector<std::string> sentences;
  for (const simulation::ObjectSpec& object : scene.objects) {
    if (!object.structures) continue;
    const structures::StructureInfo& info = object.structures->info;
    const std::size_t gaps = info.notes.find(structures::kGapNote);
    if (gaps != std::string::npos)
      sentences.push_back(
          fmt::format("{}: {}", object.title, info.notes.substr(gaps, info.notes.find('\n', gaps) - gaps)));
    if (info.thin_area <= 0.0) continue;
    sentences.push_back(
        fmt::format("{}: {} of the surface is of walls thinner than its voxels resolve; they are solid, and "
                    "up to {:.3g} mm thicker on each side; {} is open",
                    object.title, game_control::inPercent(info.thin_area / info.surface_area),
                    1e3 * object.structures->field.dilation(),
                    game_control::inPercent(info.open_area / info.surface_area)));
  }
  return sentences;
}

Result<std::string> storeAssets(const LoadedScene& loaded, const LoadOptions& options) {
  const game_control::ScenarioFile& scenario = *loaded.scenario;
  const auto parts = generatedParts(scenario, options.cache, options.detail);
  if (!parts) return fail(parts.error().what);
  const wire::AssetStore store(options.cache / "assets");
  std::string objects;
  for (const game_control::ScenarioObject& object : scenario.objects) {
    if (options.isStopped()) return fail("stopped");
    const auto meshes = meshesOf(scenario, object, *parts, options);
    if (!meshes) return fail(meshes.error().what);
    const auto levels = displayLevels(*meshes, colorNumber(object.color), store, options);
    if (!levels) return levels;
    objects += (objects.empty() ? "" : ",") + *levels;
  }
  const auto compiled = compiledScene(*loaded.scene, store);
  if (!compiled) return compiled;
  const std::string list = R"({"version":1,"compiled":")" + *compiled + R"(","objects":[)" + objects + "]}";
  return store.put({reinterpret_cast<const std::uint8_t*>(list.data()), list.size()});
}

}  // namespace tenon::session
