#include "server/bake/display_model.h"

#include <cmath>
#include <cstring>
#include <string>

#include <gtest/gtest.h>
#include <meshoptimizer.h>
#include <nlohmann/json.hpp>

#include "server/bake/shapes.h"

namespace tenon::bake {
namespace {

/// What a viewer reads from a display model, in the frame of glTF.
struct ReadModel {
  nlohmann::json json;
  std::vector<Vector3> positions;  // [m]
  std::vector<Vector3> normals;
  std::vector<std::uint32_t> indices;
};

std::uint32_t numberAt(const std::vector<std::uint8_t>& bytes, std::size_t at) {
  std::uint32_t number = 0;
  std::memcpy(&number, bytes.data() + at, sizeof number);
  return number;
}

ReadModel readGlb(const std::vector<std::uint8_t>& glb) {
  ReadModel model;
  EXPECT_EQ(std::string(glb.begin(), glb.begin() + 4), "glTF");
  EXPECT_EQ(numberAt(glb, 4), 2U);
  EXPECT_EQ(numberAt(glb, 8), glb.size());
  const std::size_t text = numberAt(glb, 12);
  model.json = nlohmann::json::parse(glb.begin() + 20, glb.begin() + 20 + static_cast<std::ptrdiff_t>(text));
  const std::size_t binary = 20 + text + 8;
  EXPECT_EQ(numberAt(glb, binary - 8), glb.size() - binary);
  const auto view = [&](std::size_t i) {
    return model.json["bufferViews"][i]["extensions"]["EXT_meshopt_compression"];
  };
  const auto data = [&](std::size_t i) {
    return glb.data() + binary + view(i)["byteOffset"].get<std::size_t>();
  };
  const auto size = [&](std::size_t i) { return view(i)["byteLength"].get<std::size_t>(); };
  const std::size_t count = model.json["accessors"][0]["count"];
  std::vector<std::array<std::uint16_t, 4>> positions(count);
  std::vector<std::array<std::int8_t, 4>> normals(count);
  EXPECT_EQ(meshopt_decodeVertexBuffer(positions.data(), count, 8, data(0), size(0)), 0);
  EXPECT_EQ(meshopt_decodeVertexBuffer(normals.data(), count, 4, data(1), size(1)), 0);
  model.indices.resize(model.json["accessors"][2]["count"].get<std::size_t>());
  EXPECT_EQ(meshopt_decodeIndexBuffer(model.indices.data(), model.indices.size(), data(2), size(2)), 0);
  const auto& node = model.json["nodes"][0];
  for (std::size_t i = 0; i < count; ++i) {
    Vector3 p, n;
    for (int axis = 0; axis < 3; ++axis) {
      const auto at = static_cast<std::size_t>(axis);
      p[axis] = node["translation"][at].get<double>() + node["scale"][at].get<double>() * positions[i][at];
      n[axis] = normals[i][at] / 127.0;
    }
    model.positions.push_back(p);
    model.normals.push_back(n);
  }
  return model;
}

TEST(DisplayModel, ABoxHasSharpEdgesAndStandsUpright) {
  TriangleMesh box = makeBox({0.2, 0.4, 0.6});
  for (Vector3f& p : box.vertices) p += Vector3f(1.0F, 2.0F, 3.0F);
  const auto models = displayModels(box);
  ASSERT_TRUE(models) << models.error().what;
  ASSERT_EQ(models->size(), 1U) << "12 triangles need no second level";
  const ReadModel read = readGlb(models->front().glb);
  EXPECT_EQ(models->front().triangles, 12U);
  EXPECT_EQ(read.indices.size(), 36U);
  EXPECT_EQ(read.positions.size(), 24U) << "each corner has three normals";
  Eigen::AlignedBox3d bounds;
  for (std::size_t i = 0; i < read.positions.size(); ++i) {
    bounds.extend(read.positions[i]);
    EXPECT_NEAR(read.normals[i].cwiseAbs().maxCoeff(), 1.0, 1e-9);
  }
  // glTF has y up: (x, y, z) of the object is (x, z, -y) there
  EXPECT_TRUE(bounds.min().isApprox(Vector3(0.9, 2.7, -2.2), 1e-5)) << bounds.min().transpose();
  EXPECT_TRUE(bounds.max().isApprox(Vector3(1.1, 3.3, -1.8), 1e-5)) << bounds.max().transpose();
  // outward, by the order of the corners
  for (std::size_t i = 0; i < 36; i += 3) {
    const Vector3& a = read.positions[read.indices[i]];
    const Vector3 normal =
        (read.positions[read.indices[i + 1]] - a).cross(read.positions[read.indices[i + 2]] - a);
    EXPECT_GT(normal.dot(read.normals[read.indices[i]]), 0.0);
    EXPECT_GT(normal.dot(a - bounds.center()), 0.0);
  }
}

TEST(DisplayModel, ManyTrianglesBecomeFewerWithinTheErrorThatIsStated) {
  constexpr double kRadius = 0.5;
  const TriangleMesh sphere = makeSphere(kRadius, 1.5e-5);
  ASSERT_GT(sphere.triangles.size(), kDisplayTriangles[0]);
  const auto models = displayModels(sphere);
  ASSERT_TRUE(models) << models.error().what;
  ASSERT_EQ(models->size(), kDisplayTriangles.size());
  for (std::size_t level = 0; level < models->size(); ++level) {
    const DisplayModel& model = (*models)[level];
    EXPECT_LE(model.triangles, kDisplayTriangles[level]);
    EXPECT_GT(model.triangles, kDisplayTriangles[level] / 2);
    EXPECT_LT(model.glb.size(), 3'000'000U);
    EXPECT_LT(model.error, 1e-3);
    const ReadModel read = readGlb(model.glb);
    for (std::size_t i = 0; i < read.positions.size(); ++i) {
      ASSERT_NEAR(read.positions[i].norm(), kRadius, model.error + 5e-5);
      ASSERT_GT(read.normals[i].dot(read.positions[i]), 0.99 * kRadius)
          << "smooth, whatever its triangles are";
    }
  }
}

TEST(DisplayModel, TheSameMeshGivesTheSameBytes) {
  const TriangleMesh mesh = makeCylinder(0.1, 0.3, 1e-4);
  EXPECT_EQ(displayModels(mesh)->front().glb, displayModels(mesh)->front().glb);
}

TEST(DisplayModel, AMeshWithoutAreaIsAnError) {
  EXPECT_FALSE(displayModels({}));
  EXPECT_FALSE(displayModels(
      {.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 0, 0}}, .triangles = {{{0, 1, 2}}}, .notes = {}}));
}

}  // namespace
}  // namespace tenon::bake
