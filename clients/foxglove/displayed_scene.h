#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "clients/foxglove/messages.h"
#include "idl/types/messages.h"
#include "idl/wire/assets.h"
#include "idl/wire/raw_subscriber.h"

/// What public viewers (Foxglove, Lichtblick) display of a session by themselves, live and of recordings.
namespace tenon::foxglove {

inline constexpr std::string_view kFrames = "/tf";     ///< FrameTransforms: objects, and devices as hand_N
inline constexpr std::string_view kModels = "/scene";  ///< SceneUpdate: objects, and the target
inline constexpr std::string_view kLogLines = "/log";  ///< Log: events of the server
inline constexpr std::string_view kTarget = "target";  ///< entity: the ghost of the part to be mounted
inline constexpr std::uint64_t kTargetInstance = 1ULL << 32U;

/// The first level of each object, by ObjectId, in the list of a scene's display models, which is the asset
/// SessionAnnounce::scene_hash; empty: it has none.
[[nodiscard]] std::vector<std::string> firstLevels(std::span<const std::uint8_t> list);

struct DisplayMessage {
  std::string_view topic;      ///< kFrames, kModels or kLogLines
  std::string entity;          ///< of kModels: that the message shows or deletes
  std::uint64_t instance = 0;  ///< likewise: its ObjectId, or kTargetInstance
  std::int64_t time_ns = 0;    ///< [ns] since 1970, of the sample
  std::vector<std::uint8_t> bytes;
};

/// Turns the samples of a session into messages that public viewers display: each object as an entity with
/// the first level of its display model, or a box where the store has none, in a frame that moves it. Both
/// are named object/NAME: a name in a scenario is any text, that of another frame or entity as well.
///
/// Threads: one. Real-time: no.
class DisplayedScene {
 public:
  explicit DisplayedScene(wire::AssetStore assets) : assets_(std::move(assets)) {}

  /// A session begins: what was known of the one before is forgotten.
  void begin(const SessionAnnounce& announce);
  /// What `sample`, which is no end of an instance, shows or deletes, and its line of the log.
  [[nodiscard]] std::vector<DisplayMessage> receive(const wire::RawSample& sample);
  /// All frames, since viewers may get the newest message alone; none when no pose has come since the last
  /// call.
  [[nodiscard]] std::optional<DisplayMessage> frames();
  /// Shows with its model what is a box because the store had none, and has it now. `time_ns`: of now.
  [[nodiscard]] std::vector<DisplayMessage> showModels(std::int64_t time_ns);
  /// Names of objects that were shown as boxes at last because the store had not their models.
  [[nodiscard]] std::vector<std::string> boxes() const;

 private:
  struct Model {
    std::vector<std::uint8_t> bytes;  ///< empty: a box
    bool is_missing = false;          ///< there is one, which the store has not
  };
  struct Part {
    SceneObject object;
    ObjectState state;
    bool is_placed = false;  ///< a state has arrived
    bool is_shown = false;   ///< its entity is published
    bool is_box = false;     ///< because its model was missing
  };

  void receiveState(const ObjectState& state, std::int64_t time_ns, std::vector<DisplayMessage>& messages);
  void receiveStep(const StepState& step, std::int64_t time_ns, std::vector<DisplayMessage>& messages);
  void showOrHide(std::uint32_t id, std::int64_t time_ns, std::vector<DisplayMessage>& messages);
  [[nodiscard]] DisplayMessage objectMessage(std::uint32_t id, std::int64_t time_ns, Model model);
  [[nodiscard]] DisplayMessage targetMessage(std::int64_t time_ns, Model model);
  void readList();
  [[nodiscard]] Model modelOf(ObjectId id) const;

  wire::AssetStore assets_;
  std::string scene_hash_;
  bool has_list_ = false;            ///< of models
  std::vector<std::string> models_;  ///< assets by ObjectId; empty: none
  std::map<std::uint32_t, Part> parts_;
  StepState target_;                    ///< whose target is shown
  bool is_target_box_ = false;          ///< because its model was missing
  std::map<std::uint32_t, Pose> X_WH_;  ///< devices by HandId
  std::int64_t moved_ns_ = 0;           ///< [ns] of the newest pose that frames() has not told; 0: none
};

}  // namespace tenon::foxglove
