#include "server/bake/display_model.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

#include <gtest/gtest.h>
#include <meshoptimizer.h>
#include <nlohmann/json.hpp>

#include "server/bake/shapes.h"

namespace tenon::bake {
namespace {

constexpr std::uint32_t kGrey = 0x808080;

/// What a viewer reads from a display model, in the frame of glTF.
struct ReadModel {
  nlohmann::json json;
  std::vector<Vector3> positions;  // [m]
  std::vector<Vector3> normals;
  std::vector<Vector3> colors;  // linear [0..1]; empty without COLOR_0
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
  const auto& primitive = model.json["meshes"][0]["primitives"][0];
  if (primitive["attributes"].contains("COLOR_0")) {
    EXPECT_EQ(primitive["attributes"]["COLOR_0"], 2);
    std::vector<std::array<std::uint16_t, 4>> colors(count);
    EXPECT_EQ(meshopt_decodeVertexBuffer(colors.data(), count, 8, data(2), size(2)), 0);
    for (const auto& [r, g, b, a] : colors) {
      model.colors.push_back(Vector3(r, g, b) / 65535.0);
      EXPECT_EQ(a, 65535);
    }
  }
  const std::size_t last = primitive["indices"];
  model.indices.resize(model.json["accessors"][last]["count"].get<std::size_t>());
  EXPECT_EQ(meshopt_decodeIndexBuffer(model.indices.data(), model.indices.size(), data(last), size(last)), 0);
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
  const auto models = displayModels(box, kGrey);
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
  const auto models = displayModels(sphere, kGrey);
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
  EXPECT_EQ(displayModels(mesh, kGrey)->front().glb, displayModels(mesh, kGrey)->front().glb);
}

TEST(DisplayModel, EachFaceHasItsColourAndOneWithoutTheGivenOne) {
  // sRGB 0x80 is 0.2158 of the light of 0xFF
  constexpr double kHalf = 0.2158;
  TriangleMesh box = makeBox({0.2, 0.4, 0.6});
  for (const auto& [a, b, c] : box.triangles) {
    const Vector3f normal = (box.vertices[b] - box.vertices[a]).cross(box.vertices[c] - box.vertices[a]);
    box.colors.push_back(normal.z() > 0.01F ? 0xFF8000 : normal.x() > 0.01F ? kNoColor : 0x0000FF);
  }
  const ReadModel read = readGlb(displayModels(box, kGrey)->front().glb);
  ASSERT_EQ(read.colors.size(), read.positions.size());
  for (std::size_t i = 0; i < read.colors.size(); ++i) {
    // z of the object is y in glTF
    const Vector3 color = read.normals[i].y() > 0.9   ? Vector3(1, kHalf, 0)
                          : read.normals[i].x() > 0.9 ? Vector3(kHalf, kHalf, kHalf)
                                                      : Vector3(0, 0, 1);
    EXPECT_LT((read.colors[i] - color).norm(), 1e-3) << read.normals[i].transpose();
  }
  EXPECT_TRUE(readGlb(displayModels(makeBox({0.2, 0.4, 0.6}), kGrey)->front().glb).colors.empty());
}

//   the border of two colours stays where it is when triangles become fewer
TEST(DisplayModel, ABorderOfColoursStays) {
  TriangleMesh sphere = makeSphere(0.5, 1.5e-5);
  ASSERT_GT(sphere.triangles.size(), kDisplayTriangles[0]);
  const auto above = [&](const auto& triangle) {
    double sum = 0.0;
    for (const std::uint32_t vertex : triangle) sum += sphere.vertices[vertex].z();
    return sum > 0.0;
  };
  double border = 0.0;  // [m] how far from z = 0 the corners of both colours go beyond it
  for (const auto& triangle : sphere.triangles) {
    sphere.colors.push_back(above(triangle) ? 0xFF0000 : 0x0000FF);
    for (const std::uint32_t vertex : triangle) {
      const double z = sphere.vertices[vertex].z();
      border = std::max(border, above(triangle) ? -z : z);
    }
  }
  const auto models = displayModels(sphere, kGrey);
  for (const DisplayModel& model : *models) {
    EXPECT_LE(model.triangles, kDisplayTriangles[0]);
    const ReadModel read = readGlb(model.glb);
    for (std::size_t i = 0; i < read.colors.size(); ++i) {
      const double z = read.positions[i].y();
      ASSERT_LE(read.colors[i].x() > 0.5 ? -z : z, border + model.error + 5e-5);
    }
  }
}

TEST(DisplayModel, AMeshWithoutAreaIsAnError) {
  EXPECT_FALSE(displayModels({}, kGrey));
  EXPECT_FALSE(displayModels(
      {.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 0, 0}}, .triangles = {{{0, 1, 2}}}, .colors = {}, .notes = {}},
      kGrey));
}

}  // namespace
}  // namespace tenon::bake
