#include "clients/foxglove/messages.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <span>

namespace tenon::foxglove {

namespace {

constexpr std::string_view kTime = "module foxglove {\nstruct Time { uint32 sec; uint32 nsec; };\n";
constexpr std::string_view kGeometry =
    "struct Vector3 { double x; double y; double z; };\n"
    "struct Quaternion { double x; double y; double z; double w; };\n";
constexpr std::string_view kEnd = "};\n";

constexpr std::string_view kTransforms =
    "struct FrameTransform { Time timestamp; string parent_frame_id; string child_frame_id;\n"
    "  Vector3 translation; Quaternion rotation; };\n"
    "struct FrameTransforms { sequence<FrameTransform> transforms; };\n";

constexpr std::string_view kScene =
    "struct Duration { int32 sec; uint32 nsec; };\n"
    "struct Pose { Vector3 position; Quaternion orientation; };\n"
    "struct Color { double r; double g; double b; double a; };\n"
    "struct KeyValuePair { string key; string value; };\n"
    "struct ArrowPrimitive { Pose pose; };\n"
    "struct CubePrimitive { Pose pose; Vector3 size; Color color; };\n"
    "struct SpherePrimitive { Pose pose; };\n"
    "struct CylinderPrimitive { Pose pose; };\n"
    "struct LinePrimitive { Pose pose; };\n"
    "struct TriangleListPrimitive { Pose pose; };\n"
    "struct TextPrimitive { Pose pose; };\n"
    "struct ModelPrimitive { Pose pose; Vector3 scale; Color color; boolean override_color; string url;\n"
    "  string media_type; sequence<uint8> data; };\n"
    "struct SceneEntityDeletion { Time timestamp; uint8 type; string id; };\n"
    "struct SceneEntity { Time timestamp; string frame_id; string id; Duration lifetime; boolean "
    "frame_locked;\n"
    "  sequence<KeyValuePair> metadata; sequence<ArrowPrimitive> arrows; sequence<CubePrimitive> cubes;\n"
    "  sequence<SpherePrimitive> spheres; sequence<CylinderPrimitive> cylinders; sequence<LinePrimitive> "
    "lines;\n"
    "  sequence<TriangleListPrimitive> triangles; sequence<TextPrimitive> texts;\n"
    "  sequence<ModelPrimitive> models; };\n"
    "struct SceneUpdate { sequence<SceneEntityDeletion> deletions; sequence<SceneEntity> entities; };\n";

constexpr std::string_view kLog =
    "struct Log { Time timestamp; uint8 level; string message; string name; string file; uint32 line; };\n";

/// Writes XCDR1, little-endian; alignment counts from behind the encapsulation header.
class CdrWriter {
 public:
  template <class T>
  void put(T value) {
    while ((bytes_.size() - kHeader) % sizeof(T) != 0) bytes_.push_back(0);
    const std::size_t at = bytes_.size();
    bytes_.resize(at + sizeof(T));
    std::memcpy(bytes_.data() + at, &value, sizeof(T));
  }
  void put(std::string_view text) {
    put(static_cast<std::uint32_t>(text.size() + 1));
    bytes_.insert(bytes_.end(), text.begin(), text.end());
    bytes_.push_back(0);
  }
  void put(std::span<const std::uint8_t> blob) {
    put(static_cast<std::uint32_t>(blob.size()));
    bytes_.insert(bytes_.end(), blob.begin(), blob.end());
  }
  void put(const Vector3& v) {
    for (int i = 0; i < 3; ++i) put(v[i]);
  }
  void put(const Pose& X) {
    put(X.translation());
    for (int i = 0; i < 4; ++i) put(X.rotation().coeffs()[i]);
  }
  void put(const Rgba& color) {
    for (const double part : color) put(part);
  }
  void putTime(std::int64_t ns) {
    constexpr std::int64_t kSecond = 1'000'000'000;
    put(static_cast<std::uint32_t>(ns / kSecond));
    put(static_cast<std::uint32_t>(ns % kSecond));
  }
  void putCount(std::uint32_t count) { put(count); }
  std::vector<std::uint8_t> take() { return std::move(bytes_); }

 private:
  static constexpr std::size_t kHeader = 4;
  std::vector<std::uint8_t> bytes_{0, 1, 0, 0};
};

std::string joined(std::initializer_list<std::string_view> parts) {
  std::string text;
  for (const std::string_view part : parts) text += part;
  return text;
}

}  // namespace

MessageType frameTransformsType() {
  return {"foxglove::FrameTransforms", joined({kTime, kGeometry, kTransforms, kEnd})};
}
MessageType sceneUpdateType() { return {"foxglove::SceneUpdate", joined({kTime, kGeometry, kScene, kEnd})}; }
MessageType logType() { return {"foxglove::Log", joined({kTime, kLog, kEnd})}; }

bool hasColors(std::span<const std::uint8_t> glb) {
  // its first chunk is JSON: length at byte 12, content from byte 20 on
  constexpr std::size_t kJson = 20;
  if (glb.size() < kJson) return false;
  std::uint32_t length = 0;
  std::memcpy(&length, glb.data() + 12, sizeof length);
  const std::size_t size = std::min<std::size_t>(length, glb.size() - kJson);
  return std::string_view(reinterpret_cast<const char*>(glb.data()) + kJson, size).find("\"COLOR_0\"") !=
         std::string_view::npos;
}

Rgba colorOf(std::string_view text) {
  Rgba color{0.6, 0.6, 0.6, 1.0};
  if ((text.size() != 7 && text.size() != 9) || text.front() != '#') return color;
  Rgba read = color;
  for (std::size_t i = 0; 2 * i + 1 < text.size(); ++i) {
    unsigned value = 0;
    const char* const first = text.data() + 1 + 2 * i;
    if (const auto [end, error] = std::from_chars(first, first + 2, value, 16);
        error != std::errc{} || end != first + 2)
      return color;
    read[i] = value / 255.0;
  }
  return read;
}

std::vector<std::uint8_t> encodeFrameTransforms(const std::vector<FrameTransform>& transforms,
                                                std::int64_t time_ns) {
  CdrWriter out;
  out.putCount(static_cast<std::uint32_t>(transforms.size()));
  for (const FrameTransform& transform : transforms) {
    out.putTime(time_ns);
    out.put(std::string_view(transform.parent));
    out.put(std::string_view(transform.child));
    out.put(transform.X_PC);
  }
  return out.take();
}

std::vector<std::uint8_t> encodeEntity(const SceneEntity& entity, std::int64_t time_ns) {
  const bool is_box = entity.glb.empty();
  CdrWriter out;
  out.putCount(0);  // deletions
  out.putCount(1);  // entities
  out.putTime(time_ns);
  out.put(std::string_view(entity.frame));
  out.put(std::string_view(entity.id));
  out.putTime(0);   // lifetime: until it is replaced or deleted
  out.put(true);    // moves with its frame
  out.putCount(0);  // metadata
  out.putCount(0);  // arrows
  out.putCount(is_box ? 1 : 0);
  if (is_box) {
    out.put(entity.X_FE * Pose(entity.centre));
    out.put(entity.size);
    out.put(entity.color);
  }
  for (int empty = 0; empty < 5; ++empty) out.putCount(0);  // spheres, cylinders, lines, triangles, texts
  out.putCount(is_box ? 0 : 1);
  if (!is_box) {
    out.put(entity.X_FE);
    out.put(Vector3(1.0, 1.0, 1.0));
    out.put(entity.color);
    out.put(!entity.own_colors);
    out.put(std::string_view());
    out.put(kModelMediaType);
    out.put(std::span<const std::uint8_t>(entity.glb));
  }
  return out.take();
}

std::vector<std::uint8_t> encodeDeletion(std::string_view id, std::int64_t time_ns) {
  CdrWriter out;
  out.putCount(1);
  out.putTime(time_ns);
  out.put(static_cast<std::uint8_t>(id.empty() ? 1 : 0));
  out.put(id);
  out.putCount(0);  // entities
  return out.take();
}

std::vector<std::uint8_t> encodeLog(const EventLog& event, std::int64_t time_ns) {
  constexpr std::array<std::uint8_t, 3> kLevels{2, 3, 4};  // info, warning, error
  CdrWriter out;
  out.putTime(time_ns);
  out.put(kLevels[std::min<std::size_t>(static_cast<std::size_t>(event.severity), 2)]);
  out.put(std::string_view(event.text));
  out.put(std::string_view(event.kind));
  out.put(std::string_view());
  out.put(std::uint32_t{0});
  return out.take();
}

}  // namespace tenon::foxglove
