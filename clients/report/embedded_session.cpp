#include "clients/report/embedded_session.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <optional>
#include <random>
#include <set>
#include <span>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "clients/foxglove/displayed_scene.h"
#include "idl/record/instance_state.h"
#include "idl/record/mcap_reader.h"
#include "idl/record/mcap_writer.h"
#include "idl/types/messages/contacts.h"
#include "idl/types/messages/hands.h"
#include "idl/types/messages/objects.h"
#include "idl/types/messages/session.h"
#include "idl/types/messages/steps.h"
#include "idl/types/messages/timing.h"
#include "idl/wire/assets.h"
#include "idl/wire/codec.h"
#include "idl/wire/topics.h"

namespace tenon::report {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kPeriod = 33'000'000;          // [ns] of WorldFrame_30
constexpr std::int64_t kSlowPeriod = 3 * kPeriod;     // [ns] of numbers that are read, not seen
constexpr double kLengthSteps = 65536.0;              // [1/m] grid of 15 um
constexpr double kForceSteps = 1024.0;                // [1/N]
constexpr std::size_t kMostEntityBytes = 32U << 20U;  // [bytes] of models in a recording
constexpr std::size_t kMaxMemory = 64U << 20U;        // [bytes] of messages before they are compressed
constexpr double kShareOfModels = 0.4;                // of the budget
constexpr int kMaxHalvings = 8;                       // 30 Hz to about one picture in 8 s

/// On the grid of 1/`steps`: trailing zeros of the numbers compress.
double onGrid(double value, double steps) { return std::nearbyint(value * steps) / steps; }
void toGrid(Vector3& vector, double steps) {
  for (double& value : vector) value = onGrid(value, steps);
}
void toGrid(Pose& pose) {
  toGrid(pose.translation(), kLengthSteps);
  for (double& value : pose.rotation().coeffs()) value = onGrid(value, kLengthSteps);  // 30 urad
}

/// The samples of a recording that a player needs.
class SessionReduction {
 public:
  Result<void> read(const fs::path& file);
  /// Every second sample of each instance of a stream.
  void halve();
  [[nodiscard]] Result<std::vector<std::uint8_t>> write() const;
  /// Writes the models, too, that the recorder kept for public viewers; the number of objects that have one.
  /// 0: there are none, or they do not fit into `budget` [bytes].
  std::size_t keepModels(std::size_t budget);
  [[nodiscard]] int halvings() const { return halvings_; }
  [[nodiscard]] const std::string& models() const { return models_; }
  [[nodiscard]] std::size_t objects() const { return objects_.size(); }
  [[nodiscard]] bool hasPoses() const { return has_poses_; }

 private:
  struct Sample {
    std::string_view topic;  // of a static text
    std::string_view type;
    std::int64_t log_time_ns = 0;
    std::vector<std::uint8_t> bytes;
    std::optional<std::uint32_t> instance;  // of a stream
  };
  using Instance = std::pair<std::string_view, std::uint32_t>;

  /// An entity of foxglove::DisplayedScene.
  struct Entity {
    std::int64_t log_time_ns = 0;
    std::vector<std::uint8_t> bytes;
  };

  void add(const record::McapMessage& message);
  void addState(std::string_view topic, const record::McapMessage& message);
  bool isDue(Instance instance, std::int64_t log_time_ns, std::int64_t period);
  template <class M>
  void addStream(const wire::Topic<M>& topic, const record::McapMessage& message, std::uint32_t instance,
                 const M& sample);
  template <class M>
  void addNumbers(const wire::Topic<M>& topic, const record::McapMessage& message);
  void addEntity(const record::McapMessage& message);
  void addFrame(const record::McapMessage& message);
  void addHand(const record::McapMessage& message);
  void addPairs(const record::McapMessage& message);

  std::vector<Sample> samples_;
  std::map<std::string, Entity, std::less<>> entities_;  ///< by topic: the first of each object
  std::size_t entity_bytes_ = 0;
  bool writes_entities_ = false;
  std::map<Instance, std::int64_t> newest_;                                              // [ns]
  std::map<std::uint32_t, std::set<std::pair<std::uint32_t, std::uint32_t>>> touching_;  // pairs by part
  std::set<std::uint32_t> objects_;
  std::string models_;
  std::size_t bytes_ = 0;
  int halvings_ = 0;
  bool has_poses_ = false;
};

Result<void> SessionReduction::read(const fs::path& file) {
  auto recording = record::McapReader::open(file);
  if (!recording) return fail(recording.error().what);
  for (record::McapMessage message; recording->next(message);) {
    add(message);
    while (bytes_ > kMaxMemory && halvings_ < kMaxHalvings) halve();
  }
  std::stable_sort(samples_.begin(), samples_.end(),
                   [](const Sample& a, const Sample& b) { return a.log_time_ns < b.log_time_ns; });
  return {};
}

void SessionReduction::add(const record::McapMessage& message) {
  static const std::set<std::string_view> kStates{
      wire::kSessionAnnounce.name, wire::kSceneObject.name,    wire::kSceneHand.name,
      wire::kSceneStep.name,       wire::kSceneTitle.name,     wire::kObjectSnapshot.name,
      wire::kStepState.name,       wire::kRunState.name,       wire::kGrabState.name,
      wire::kPresence.name,        wire::kEmergencyStop.name,  wire::kEmergencyClear.name,
      wire::kEventLog.name,        record::kInstanceStateTopic};
  if (const auto state = kStates.find(message.topic); state != kStates.end())
    addState(*state, message);
  else if (message.topic == wire::kWorldFrame30.name)
    addFrame(message);
  else if (message.topic == wire::kHandState100.name)
    addHand(message);
  else if (message.topic == wire::kContactPairs100.name)
    addPairs(message);
  else if (message.topic == wire::kTickStats100.name)
    addNumbers(wire::kTickStats100, message);
  else if (message.topic == wire::kStepProgress.name)
    addNumbers(wire::kStepProgress, message);
  else if (message.topic.starts_with(fmt::format("{}/", foxglove::kModels)))
    addEntity(message);
}

void SessionReduction::addEntity(const record::McapMessage& message) {
  const std::string_view text(reinterpret_cast<const char*>(message.data.data()), message.data.size());
  const bool is_box = text.find(foxglove::kModelMediaType) == std::string_view::npos;
  if (is_box || entity_bytes_ + text.size() > kMostEntityBytes || entities_.contains(message.topic)) return;
  entity_bytes_ += message.data.size();
  entities_.emplace(message.topic, Entity{message.log_time_ns, {message.data.begin(), message.data.end()}});
}

std::size_t SessionReduction::keepModels(std::size_t budget) {
  writes_entities_ = entity_bytes_ <= budget;
  return writes_entities_ ? entities_.size() : 0;
}

void SessionReduction::addState(std::string_view topic, const record::McapMessage& message) {
  if (topic == wire::kSessionAnnounce.name)
    if (const auto announce = wire::decode<SessionAnnounce>(message.data)) models_ = announce->scene_hash;
  if (topic == wire::kSceneObject.name)
    if (const auto object = wire::decode<SceneObject>(message.data)) objects_.insert(object->object.value);
  static std::set<std::string, std::less<>> types;  // outlive the reader
  const auto type = types.emplace(message.type_name).first;
  samples_.push_back({topic, *type, message.log_time_ns,
                      std::vector<std::uint8_t>(message.data.begin(), message.data.end()), std::nullopt});
  bytes_ += message.data.size();
}

/// Whether a sample is wanted that comes so long after the last one of its instance.
bool SessionReduction::isDue(Instance instance, std::int64_t log_time_ns, std::int64_t period) {
  const auto [known, is_first] = newest_.try_emplace(instance, log_time_ns);
  // samples in real time come a little early or late
  const std::int64_t least = (period << halvings_) * 9 / 10;
  if (!is_first && log_time_ns - known->second < least) return false;
  known->second = log_time_ns;
  return true;
}

template <class M>
void SessionReduction::addStream(const wire::Topic<M>& topic, const record::McapMessage& message,
                                 std::uint32_t instance, const M& sample) {
  auto bytes = wire::encode(sample);
  if (!bytes) return;
  bytes_ += bytes->size();
  samples_.push_back({topic.name, wire::typeName<M>(), message.log_time_ns, std::move(*bytes), instance});
}

template <class M>
void SessionReduction::addNumbers(const wire::Topic<M>& topic, const record::McapMessage& message) {
  const auto sample = wire::decode<M>(message.data);
  if (sample && isDue({topic.name, 0}, message.log_time_ns, kSlowPeriod))
    addStream(topic, message, 0, *sample);
}

void SessionReduction::addFrame(const record::McapMessage& message) {
  auto frame = wire::decode<WorldFrame>(message.data);
  if (!frame || !isDue({wire::kWorldFrame30.name, frame->part}, message.log_time_ns, kPeriod)) return;
  for (ObjectState& state : frame->states) {
    toGrid(state.X_WO);
    state.V_WO.setZero();
  }
  has_poses_ = true;
  addStream(wire::kWorldFrame30, message, frame->part, *frame);
}

void SessionReduction::addHand(const record::McapMessage& message) {
  auto hand = wire::decode<HandState>(message.data);
  if (!hand || !isDue({wire::kHandState100.name, hand->hand.value}, message.log_time_ns, kPeriod)) return;
  toGrid(hand->X_WH);
  toGrid(hand->F_Ho_W.force, kForceSteps);
  hand->F_Ho_W.torque.setZero();
  hand->p_WC.setZero();
  hand->X_WO_local = Pose();
  addStream(wire::kHandState100, message, hand->hand.value, *hand);
}

void SessionReduction::addPairs(const record::McapMessage& message) {
  auto pairs = wire::decode<ContactPairs>(message.data);
  if (!pairs) return;
  std::set<std::pair<std::uint32_t, std::uint32_t>> touching;
  for (PairContact& pair : pairs->pairs) {
    if (pair.colliding) touching.emplace(pair.a.value, pair.b.value);
    toGrid(pair.F_Ao_W.force, kForceSteps);
    pair.F_Ao_W.torque.setZero();
    toGrid(pair.p_WP, kLengthSteps);
    for (double* number : {&pair.depth, &pair.gap, &pair.peak_depth})
      *number = onGrid(*number, 16.0 * kLengthSteps);
    for (double* number : {&pair.peak_force, &pair.load_percent}) *number = onGrid(*number, kForceSteps);
  }
  // begin and end of a contact at any time
  auto& before = touching_[pairs->part];
  if (!isDue({wire::kContactPairs100.name, pairs->part}, message.log_time_ns, kPeriod) && touching == before)
    return;
  before = std::move(touching);
  addStream(wire::kContactPairs100, message, pairs->part, *pairs);
}

void SessionReduction::halve() {
  std::map<Instance, std::size_t> counts;
  std::erase_if(samples_, [&](const Sample& sample) {
    const bool drops = sample.instance && ++counts[{sample.topic, *sample.instance}] % 2 == 0;
    if (drops) bytes_ -= sample.bytes.size();
    return drops;
  });
  ++halvings_;
}

Result<std::vector<std::uint8_t>> SessionReduction::write() const {
  const fs::path file =
      fs::temp_directory_path() / fmt::format("tenon-report-{:08x}.mcap", std::random_device{}());
  const auto written = [&]() -> Result<void> {
    auto writer = record::McapWriter::open(file);
    if (!writer) return fail(writer.error().what);
    for (const Sample& sample : samples_) {
      const bool is_gone = sample.topic == record::kInstanceStateTopic;
      const auto channel = writer->addChannel(sample.topic, sample.type,
                                              is_gone ? record::kInstanceStateIdl : wire::idlText());
      if (auto done = writer->write(channel, sample.log_time_ns, 0, sample.bytes); !done) return done;
    }
    if (writes_entities_) {
      const foxglove::MessageType type = foxglove::sceneUpdateType();
      for (const auto& [topic, entity] : entities_) {
        const auto channel = writer->addChannel(topic, type.name, type.schema);
        if (auto done = writer->write(channel, entity.log_time_ns, 0, entity.bytes); !done) return done;
      }
    }
    return writer->close();
  }();
  std::ifstream in(file, std::ios::binary);
  std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  in.close();
  std::error_code ignored;
  fs::remove(file, ignored);
  if (!written) return fail(written.error().what);
  return bytes;
}

/// The display models of a scene, of each object the finest level with which all fit into `budget` [bytes].
void addModels(const std::string& list, const wire::AssetStore& store, std::size_t budget,
               EmbeddedSession& session) {
  const auto bytes = store.get(list);
  if (!bytes) return;
  const auto models = nlohmann::json::parse(bytes->begin(), bytes->end(), nullptr, false);
  if (!models.is_object() || !models.contains("objects") || !models["objects"].is_array()) return;
  struct Choice {
    std::vector<std::pair<nlohmann::json, std::vector<std::uint8_t>>> levels;  // from fine to coarse
    std::size_t level = 0;
  };
  std::vector<Choice> choices;
  for (const nlohmann::json& levels : models["objects"]) {
    Choice& choice = choices.emplace_back();
    for (const nlohmann::json& level : levels)
      if (auto model = store.get(level.value("model", "")))
        choice.levels.emplace_back(level, std::move(*model));
  }
  const auto total = [&] {
    std::map<std::string, std::size_t> sizes;  // objects may share a model
    for (const Choice& choice : choices)
      if (!choice.levels.empty())
        sizes[choice.levels[choice.level].first.value("model", "")] =
            choice.levels[choice.level].second.size();
    std::size_t sum = 0;
    for (const auto& [name, size] : sizes) sum += size;
    return sum;
  };
  while (total() > budget) {
    Choice* largest = nullptr;
    for (Choice& choice : choices)
      if (choice.level + 1 < choice.levels.size() &&
          (largest == nullptr ||
           choice.levels[choice.level].second.size() > largest->levels[largest->level].second.size()))
        largest = &choice;
    if (largest == nullptr) return;
    ++largest->level;
  }
  nlohmann::json chosen = {{"version", 1}, {"objects", nlohmann::json::array()}};
  for (const Choice& choice : choices) {
    nlohmann::json& levels = chosen["objects"].emplace_back(nlohmann::json::array());
    if (choice.levels.empty()) continue;
    const auto& [level, model] = choice.levels[choice.level];
    levels.push_back(level);
    session.assets[level.value("model", "")] = model;
    ++session.models;
  }
  const std::string text = chosen.dump();
  session.assets[list] = std::vector<std::uint8_t>(text.begin(), text.end());
}

}  // namespace

Result<EmbeddedSession> embedSession(const fs::path& file, const fs::path& cache, std::size_t budget) {
  SessionReduction reduction;
  if (auto read = reduction.read(file); !read) return fail(read.error().what);
  if (!reduction.hasPoses()) return fail("the recording has no poses (topic WorldFrame_30)");
  EmbeddedSession session;
  session.objects = reduction.objects();
  const auto share = static_cast<std::size_t>(kShareOfModels * static_cast<double>(budget));
  addModels(reduction.models(), wire::AssetStore(cache / "assets"), share, session);
  if (session.models == 0) session.models = reduction.keepModels(share);
  for (const auto& [name, bytes] : session.assets) budget -= std::min(budget, bytes.size());
  while (true) {
    auto recording = reduction.write();
    if (!recording) return fail(recording.error().what);
    session.recording = std::move(*recording);
    if (session.recording.size() <= budget) break;
    if (reduction.halvings() == kMaxHalvings) return fail("the session is too long to be inside a report");
    reduction.halve();
  }
  session.rate = 1e9 / static_cast<double>(kPeriod << reduction.halvings());
  return session;
}

}  // namespace tenon::report
