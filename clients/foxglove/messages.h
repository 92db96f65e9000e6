#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/messages/log.h"
#include "idl/types/spatial.h"

/// The messages that Foxglove and Lichtblick display without a plug-in, as CDR (XCDR1, little-endian), and
/// the schemas they are read by. Names and members are those of Foxglove's schemas; members that nothing here
/// fills are lists of length zero, whose types are empty but for their first member.
///
/// Threads: pure. Real-time: no.
namespace tenon::foxglove {

struct MessageType {
  std::string_view name;  ///< fully scoped
  std::string schema;     ///< omgidl
};
[[nodiscard]] MessageType frameTransformsType();
[[nodiscard]] MessageType sceneUpdateType();
[[nodiscard]] MessageType logType();

using Rgba = std::array<double, 4>;  ///< [-] red, green, blue, opacity, each 0..1
/// Of `#rrggbb` or `#rrggbbaa`; grey for any other text.
[[nodiscard]] Rgba colorOf(std::string_view text);

/// Pose of frame `child` in frame `parent`.
struct FrameTransform {
  std::string parent;
  std::string child;
  Pose X_PC;
};
/// `time_ns` [ns] since 1970, here and below.
[[nodiscard]] std::vector<std::uint8_t> encodeFrameTransforms(const std::vector<FrameTransform>& transforms,
                                                              std::int64_t time_ns);

inline constexpr std::string_view kModelMediaType = "model/gltf-binary";

/// A thing that is displayed: a model, or a box where there is none.
struct SceneEntity {
  std::string id;     ///< replaces an earlier entity of this id
  std::string frame;  ///< it moves with
  Pose X_FE;
  Rgba color{};
  std::vector<std::uint8_t> glb;     ///< y up; empty: a box
  bool own_colors = false;           ///< the model's colours instead of `color`
  Vector3 size = Vector3::Zero();    ///< [m] of the box
  Vector3 centre = Vector3::Zero();  ///< [m] of the box, in the entity's frame
};
/// Whether a binary glTF file has colours of its own (COLOR_0).
[[nodiscard]] bool hasColors(std::span<const std::uint8_t> glb);
[[nodiscard]] std::vector<std::uint8_t> encodeEntity(const SceneEntity& entity, std::int64_t time_ns);
/// Removes the entity; an empty `id` removes all.
[[nodiscard]] std::vector<std::uint8_t> encodeDeletion(std::string_view id, std::int64_t time_ns);

[[nodiscard]] std::vector<std::uint8_t> encodeLog(const EventLog& event, std::int64_t time_ns);

}  // namespace tenon::foxglove
