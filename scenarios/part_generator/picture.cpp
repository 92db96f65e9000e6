#include "scenarios/part_generator/picture.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include <fmt/format.h>
#include <png.h>

#include "scenarios/part_generator/raster.h"

namespace tenon::part_generator {
namespace {

constexpr int kSupersampling = 2;  ///< samples along each side of a pixel
constexpr int kShadowMapSize = 3072;
constexpr Color kGround = 0xC9CED3;
const Vector3 kSun = Vector3(-0.45, -0.60, 1.15).normalized();  ///< unit vector towards it, in W

/// Approximate linear intensity of an sRGB colour.
Vector3f linear(Color color) {
  const auto channel = [&](unsigned shift) {
    const float c = static_cast<float>((color >> shift) & 0xFFU) / 255.0F;
    return c * c * (0.2F + 0.8F * c);
  };
  return {channel(16), channel(8), channel(0)};
}

struct SceneRenderer {
  const PictureCamera& camera;
  SampleBuffer solid;
  SampleBuffer ghost;
  std::vector<float> opacity;
  SampleBuffer shadow{kShadowMapSize, kShadowMapSize};
  Projection eye;
  Projection sun;
  std::vector<Vector3f> light;

  explicit SceneRenderer(const PictureCamera& camera_)
      : camera(camera_),
        solid(kSupersampling * camera_.width, kSupersampling * camera_.height),
        ghost(kSupersampling * camera_.width, kSupersampling * camera_.height),
        opacity(solid.depth.size(), 0.0F),
        light(solid.depth.size()) {
    eye.R_EW = lookAlong(camera.p_WT - camera.p_WE);
    eye.p_WE = camera.p_WE;
    eye.focal = 0.5 * solid.height / camera.half_angle_tangent;
    eye.centre_x = 0.5 * solid.width;
    eye.centre_y = 0.5 * solid.height;
    sun.R_EW = lookAlong(-kSun);
    sun.p_WE = camera.p_WT + 8.0 * kSun;
    sun.scale = kShadowMapSize / 5.2;
    sun.centre_x = sun.centre_y = 0.5 * kShadowMapSize;
  }

  void draw(const PictureObject& object);
  void drawGround();
  [[nodiscard]] float sunlight(const Vector3& p_W, const Vector3& normal_W) const;
  [[nodiscard]] float ambientVisibility(int x, int y) const;
  [[nodiscard]] float outline(const SampleBuffer& buffer, int x, int y) const;
  [[nodiscard]] Vector3f shade(const SampleBuffer& buffer, int x, int y, float open) const;
  [[nodiscard]] Vector3f background(int y) const;
  void shadeAll();
  [[nodiscard]] std::vector<png_byte> toneMap() const;
};

void SceneRenderer::draw(const PictureObject& object) {
  const auto normals = smoothNormals(*object.mesh);
  const Eigen::Matrix3f R_WO = object.X_WO.matrix().cast<float>();
  const bool is_ghost = object.opacity < 1.0;
  SampleBuffer& target = is_ghost ? ghost : solid;
  for (std::size_t i = 0; i < object.mesh->triangles.size(); ++i) {
    const auto& t = object.mesh->triangles[i];
    const std::array<Vector3, 3> corners_W{object.X_WO * t[0], object.X_WO * t[1], object.X_WO * t[2]};
    const std::array<Vector3f, 3> normals_W{R_WO * normals[i][0], R_WO * normals[i][1], R_WO * normals[i][2]};
    const Color color = object.color.value_or(object.mesh->paint[i]);
    drawTriangle(target, eye, corners_W, normals_W, color);
    if (!is_ghost) drawTriangle(shadow, sun, corners_W, normals_W, color);
  }
  if (!is_ghost) return;
  for (std::size_t i = 0; i < opacity.size(); ++i) {
    if (ghost.depth[i] < SampleBuffer::kFar && opacity[i] == 0.0F)
      opacity[i] = static_cast<float>(object.opacity);
  }
}

void SceneRenderer::drawGround() {
  for (int y = 0; y < solid.height; ++y) {
    for (int x = 0; x < solid.width; ++x) {
      const Vector3 along = eye.unproject(x + 0.5, y + 0.5, 1.0) - eye.p_WE;
      if (along.z() > -1e-3) continue;
      const double depth = -eye.p_WE.z() / along.z();
      const std::size_t index = solid.at(x, y);
      if (depth <= 0.0 || static_cast<float>(depth) >= solid.depth[index]) continue;
      solid.depth[index] = static_cast<float>(depth);
      solid.normal[index] = Vector3f::UnitZ();
      solid.color[index] = kGround;
    }
  }
}

/// Visible fraction of the sun, averaged over a patch of the shadow map for soft shadows.
float SceneRenderer::sunlight(const Vector3& p_W, const Vector3& normal_W) const {
  const Vector3 p = sun.project(p_W + 0.004 * normal_W);
  constexpr int kRadius = 3;
  int lit = 0;
  int samples = 0;
  for (int dy = -kRadius; dy <= kRadius; ++dy) {
    for (int dx = -kRadius; dx <= kRadius; ++dx) {
      const int x = static_cast<int>(p.x()) + dx;
      const int y = static_cast<int>(p.y()) + dy;
      ++samples;
      if (x < 0 || y < 0 || x >= kShadowMapSize || y >= kShadowMapSize) {
        ++lit;
      } else if (shadow.depth[shadow.at(x, y)] > static_cast<float>(p.z() - 0.003)) {
        ++lit;
      }
    }
  }
  return static_cast<float>(lit) / static_cast<float>(samples);
}

/// Screen-space ambient occlusion: fraction of the sky over a sample that near surfaces leave visible, from
/// probes on a fixed spiral at distances of 6 to 206 mm.
float SceneRenderer::ambientVisibility(int x, int y) const {
  const std::size_t index = solid.at(x, y);
  const double depth = solid.depth[index];
  const Vector3 p_W = eye.unproject(x + 0.5, y + 0.5, depth);
  const Vector3 normal = solid.normal[index].cast<double>();
  const double rotation = 0.7 * ((x * 7 + y * 13) % 16);
  double occluded = 0.0;
  constexpr int kProbes = 20;
  for (int i = 0; i < kProbes; ++i) {
    const double fraction = (i + 0.5) / kProbes;
    const double distance = 0.006 + 0.20 * fraction * fraction;
    const double angle = 2.399963 * i + rotation;
    const double height = 0.15 + 0.75 * ((i * 5) % kProbes) / kProbes;
    const double flat = std::sqrt(1.0 - height * height);
    const Vector3 side =
        (std::abs(normal.z()) < 0.9 ? normal.cross(Vector3::UnitZ()) : normal.cross(Vector3::UnitX()))
            .normalized();
    const Vector3 probe =
        p_W + 0.002 * normal +
        distance * (height * normal + flat * (std::cos(angle) * side + std::sin(angle) * normal.cross(side)));
    const Vector3 q = eye.project(probe);
    const int qx = static_cast<int>(q.x());
    const int qy = static_cast<int>(q.y());
    if (qx < 0 || qy < 0 || qx >= solid.width || qy >= solid.height) continue;
    const double gap = q.z() - solid.depth[solid.at(qx, qy)];
    if (gap > 0.0015) occluded += gap < 1.5 * distance + 0.01 ? 1.0 : 0.25;
  }
  return static_cast<float>(std::max(0.0, 1.0 - 1.25 * occluded / kProbes));
}

/// Darkening of a sample by outlines, 0 to 1: at discontinuities of depth and of normals.
float SceneRenderer::outline(const SampleBuffer& buffer, int x, int y) const {
  if (x < 1 || y < 1 || x + 1 >= buffer.width || y + 1 >= buffer.height) return 0.0F;
  const float depth = buffer.depth[buffer.at(x, y)];
  const float bend = std::abs(1.0F / buffer.depth[buffer.at(x - 1, y)] +
                              1.0F / buffer.depth[buffer.at(x + 1, y)] - 2.0F / depth) +
                     std::abs(1.0F / buffer.depth[buffer.at(x, y - 1)] +
                              1.0F / buffer.depth[buffer.at(x, y + 1)] - 2.0F / depth);
  const float crease = 2.0F - buffer.normal[buffer.at(x - 1, y)].dot(buffer.normal[buffer.at(x + 1, y)]) -
                       buffer.normal[buffer.at(x, y - 1)].dot(buffer.normal[buffer.at(x, y + 1)]);
  return std::clamp(60.0F * bend * depth - 0.15F, 0.0F, 0.55F) +
         std::clamp(0.35F * crease - 0.05F, 0.0F, 0.22F);
}

Vector3f SceneRenderer::shade(const SampleBuffer& buffer, int x, int y, float open) const {
  const std::size_t index = buffer.at(x, y);
  const Vector3 p_W = eye.unproject(x + 0.5, y + 0.5, buffer.depth[index]);
  const Vector3 view = (eye.p_WE - p_W).normalized();
  Vector3 normal = buffer.normal[index].cast<double>();
  if (normal.dot(view) < 0.0) normal = -normal;  // open sheets are visible from both sides
  const Vector3f base = linear(buffer.color[index]);
  const float lit = static_cast<float>(std::max(0.0, normal.dot(kSun))) * sunlight(p_W, normal);
  const Vector3f sky(0.80F, 0.90F, 1.05F);
  const Vector3f floor(0.42F, 0.40F, 0.38F);
  const auto up = static_cast<float>(0.5 + 0.5 * normal.z());
  const Vector3f ambient = 0.58F * open * (up * sky + (1.0F - up) * floor);
  const Vector3f warm(1.30F, 1.22F, 1.10F);
  const Vector3 fill_from = Vector3(0.8, -0.5, 0.35).normalized();
  const float fill = 0.22F * static_cast<float>(std::max(0.0, normal.dot(fill_from))) * open;
  const double half_vector_cosine = std::max(0.0, normal.dot((kSun + view).normalized()));
  const float specular = 0.22F * lit * static_cast<float>(std::pow(half_vector_cosine, 40.0));
  const auto grazing = static_cast<float>(std::pow(1.0 - std::max(0.0, normal.dot(view)), 4.0));
  Vector3f out = base.cwiseProduct(ambient + lit * warm + Vector3f::Constant(fill)) +
                 Vector3f::Constant(specular) + 0.10F * grazing * open * sky;
  return out;
}

Vector3f SceneRenderer::background(int y) const {
  const float fraction = static_cast<float>(y) / static_cast<float>(solid.height);
  return (1.0F - fraction) * Vector3f(0.60F, 0.68F, 0.76F) + fraction * Vector3f(0.86F, 0.88F, 0.90F);
}

void SceneRenderer::shadeAll() {
  for (int y = 0; y < solid.height; ++y) {
    for (int x = 0; x < solid.width; ++x) {
      const std::size_t index = solid.at(x, y);
      Vector3f out = background(y);
      if (solid.depth[index] < SampleBuffer::kFar) {
        out = shade(solid, x, y, ambientVisibility(x, y)) * (1.0F - outline(solid, x, y));
        if (solid.color[index] == kGround) {
          // the ground fades into the background with distance
          const Vector3 p_W = eye.unproject(x + 0.5, y + 0.5, solid.depth[index]);
          const double distance = (p_W - Vector3(camera.p_WT.x(), camera.p_WT.y(), 0.0)).norm();
          const auto fade = static_cast<float>(std::clamp((distance - 1.8) / 3.2, 0.0, 1.0));
          out = (1.0F - fade) * out + fade * background(y);
        }
      }
      if (ghost.depth[index] < solid.depth[index]) {
        const Vector3f ghost_color = shade(ghost, x, y, 1.0F);
        const float edge = outline(ghost, x, y);
        const float cover = std::min(1.0F, opacity[index] + 0.5F * edge);
        out = (1.0F - cover) * out + cover * (1.0F - 0.6F * edge) * ghost_color;
      }
      light[index] = out;
    }
  }
}

std::vector<png_byte> SceneRenderer::toneMap() const {
  std::vector<png_byte> pixels;
  pixels.reserve(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height) * 3);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      Vector3f sum = Vector3f::Zero();
      for (int dy = 0; dy < kSupersampling; ++dy) {
        for (int dx = 0; dx < kSupersampling; ++dx) {
          // samples are tone-mapped before they are averaged, otherwise bright edges look jagged
          const Vector3f& c = light[solid.at(kSupersampling * x + dx, kSupersampling * y + dy)];
          for (int k = 0; k < 3; ++k) sum[k] += c[k] * (1.0F + c[k] / 3.2F) / (1.0F + c[k] * 0.55F);
        }
      }
      for (int k = 0; k < 3; ++k) {
        const float value =
            std::pow(std::clamp(sum[k] / (kSupersampling * kSupersampling), 0.0F, 1.0F), 1.0F / 2.2F);
        pixels.push_back(static_cast<png_byte>(std::lround(255.0F * value)));
      }
    }
  }
  return pixels;
}

}  // namespace

Result<void> renderScene(std::span<const PictureObject> objects, const PictureCamera& camera,
                         const std::filesystem::path& file) {
  SceneRenderer renderer(camera);
  for (const PictureObject& object : objects) renderer.draw(object);
  renderer.drawGround();
  renderer.shadeAll();
  const std::vector<png_byte> pixels = renderer.toneMap();
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(camera.width);
  image.height = static_cast<png_uint_32>(camera.height);
  image.format = PNG_FORMAT_RGB;
  if (png_image_write_to_file(&image, file.c_str(), 0, pixels.data(), 0, nullptr) == 0) {
    return fail(fmt::format("{}: the picture cannot be written: {}", file.string(), image.message));
  }
  return {};
}

}  // namespace tenon::part_generator
