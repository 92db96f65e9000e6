#pragma once

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "server/session/scene_loader.h"

namespace tenon::test {

/// Scenarios of a fixed part and one in a hand, loaded as a server loads them.
class TwoParts : public ::testing::Test {
 protected:
  ~TwoParts() override { std::filesystem::remove_all(folder_); }

  /// `fixed` and `held` are meshes of a scenario. Points are 4 mm apart, voxels `voxel_mm`; `refine` are more
  /// keys of the fixed part's structures.
  std::shared_ptr<const simulation::Scene> load(const std::string& fixed, const std::string& held,
                                                double voxel_mm,
                                                const std::string& refine = "refinement: 1") {
    const auto structures = [&](const std::string& keys) {
      return fmt::format("structures: {{voxel: {} mm, spacing: 4 mm, {}}}", voxel_mm, keys);
    };
    std::filesystem::create_directories(folder_);
    const std::filesystem::path file = folder_ / "scenario.yaml";
    std::ofstream(file) << "objects:\n  - {name: fixed, status: fixed, meshes: [" << fixed << "], "
                        << structures(refine) << "}\n  - {name: held, meshes: [" << held << "], "
                        << structures("refinement: 1") << ", start: {at: [0, 0, 0.2]}}\n"
                        << "hands: [{name: right, object: held}]\n"
                        << "pairs: [{between: [fixed, held]}]\n"
                        << "states: [{name: wait, conditions: [{command: fulfilled}]}]\n";
    const auto loaded = session::loadScene(file, {.cache = folder_ / "cache"});
    EXPECT_TRUE(loaded) << (loaded ? "" : loaded.error().what);
    return loaded ? loaded->scene : nullptr;
  }

  /// The same scene, whose parts have no features: one direction is asked, as a comparison.
  static std::shared_ptr<const simulation::Scene> withoutFeatures(const simulation::Scene& scene) {
    auto bare = std::make_shared<simulation::Scene>(scene);
    for (simulation::ObjectSpec& object : bare->objects) {
      auto structures = std::make_shared<structures::HapticStructures>(*object.structures);
      structures->features = {};
      object.structures = structures;
    }
    return bare;
  }

  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / fmt::format("tenon_two_parts_{}", getpid());
};

}  // namespace tenon::test
