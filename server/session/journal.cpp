#include "server/session/journal.h"

#include <fmt/format.h>

#include "idl/record/mcap_reader.h"
#include "idl/wire/codec.h"
#include "idl/wire/topics.h"

namespace tenon {
namespace {

constexpr std::string_view kMetadata = "tenon journal";
constexpr std::string_view kRecordingMetadata = "tenon recording";  // of `tenon record`
constexpr std::string_view kScenarioHash = "scenario hash";
constexpr std::string_view kStructuresOf = "structures of ";
constexpr std::int64_t kNanosecondsPerTick = 1'000'000;

/// Collects the parts of one tick.
template <typename Part>
class Assembler {
 public:
  /// True when `part` was the last one missing; the bytes are whole then.
  bool add(const Part& part) {
    if (part.tick != tick_ || part.part == 0) {
      bytes_.clear();
      next_ = 0;
      tick_ = part.tick;
    }
    if (part.part != next_) return false;
    ++next_;
    bytes_.insert(bytes_.end(), part.bytes.begin(), part.bytes.end());
    return next_ == part.parts;
  }
  [[nodiscard]] std::span<const std::uint8_t> bytes() const { return bytes_; }

 private:
  Tick tick_ = 0;
  std::uint32_t next_ = 0;
  std::vector<std::uint8_t> bytes_;
};

/// One re-run: the state it is in between messages.
class Rerunner {
 public:
  explicit Rerunner(Exercise& exercise) : exercise_(exercise) {}

  Result<void> read(const McapMessage& message) {
    if (message.topic == kTickInput.name) return readInput(message);
    if (message.topic == kCheckpoint.name) return readCheckpoint(message);
    return {};
  }
  [[nodiscard]] const RerunReport& report() const { return report_; }

 private:
  Result<void> readInput(const McapMessage& message) {
    const auto part = decode<TickInputPart>(message.data);
    if (!part) return fail(part.error().what);
    if (!inputs_.add(*part)) return {};
    const auto input = readTickInput(inputs_.bytes());
    if (!input) return fail(input.error().what);
    const Tick expected = exercise_.now() + 1;
    if (input->tick < expected) return {};
    if (input->tick > expected) {
      in_step_ = false;
      return {};
    }
    if (!in_step_) return {};
    exercise_.tick(*input);
    compare(input->tick, part->state_hash);
    return {};
  }

  Result<void> readCheckpoint(const McapMessage& message) {
    const auto part = decode<CheckpointPart>(message.data);
    if (!part) return fail(part.error().what);
    if (!checkpoints_.add(*part) || in_step_) return {};
    if (auto restored = exercise_.restore(checkpoints_.bytes()); !restored) return restored;
    if (report_.compared > 0) ++report_.gaps;
    in_step_ = true;
    return {};
  }

  void compare(Tick tick, std::uint64_t hash) {
    if (report_.compared++ == 0) report_.first = tick;
    report_.last = tick;
    report_.final_hash = exercise_.hash();
    if (report_.final_hash != hash && !report_.first_difference) report_.first_difference = tick;
  }

  Exercise& exercise_;
  Assembler<TickInputPart> inputs_;
  Assembler<CheckpointPart> checkpoints_;
  RerunReport report_;
  bool in_step_ = false;
};

}  // namespace

Result<Journal> Journal::open(const std::filesystem::path& file, const JournalOrigin& origin) {
  auto writer = McapWriter::open(file);
  if (!writer) return fail(writer.error().what);
  Journal journal(std::move(*writer));
  journal.inputs_ = journal.writer_.addChannel(kTickInput.name, typeName<TickInputPart>(), idlText());
  journal.checkpoints_ = journal.writer_.addChannel(kCheckpoint.name, typeName<CheckpointPart>(), idlText());
  std::map<std::string, std::string> made{{"scenario", origin.scenario},
                                          {"detail", fmt::format("{}", origin.detail)},
                                          {std::string(kScenarioHash), origin.made_of.scenario}};
  for (const auto& [object, hash] : origin.made_of.structures)
    made[std::string(kStructuresOf) + object] = hash;
  const auto noted = journal.writer_.addMetadata(kMetadata, made);
  if (!noted) return fail(noted.error().what);
  return journal;
}

Result<void> Journal::write(const JournalEntry& entry) {
  Result<void> result;
  const auto log_time = static_cast<std::int64_t>(entry.input.tick) * kNanosecondsPerTick;
  const auto put = [&](std::uint16_t channel, const auto& part) {
    const auto data = encode(part);
    const auto done = data ? writer_.write(channel, log_time, part.part, *data) : fail(data.error().what);
    if (!done) result = done;
  };
  bytes_.clear();
  appendBytes(entry.input, bytes_);
  forEachPart<TickInputPart>(entry.input.tick, entry.hash, bytes_,
                             [&](const auto& part) { put(inputs_, part); });
  if (!entry.checkpoint.empty())
    forEachPart<CheckpointPart>(entry.input.tick, entry.hash, entry.checkpoint,
                                [&](const auto& part) { put(checkpoints_, part); });
  return result;
}

Result<void> Journal::close(const RunState& run) {
  const auto noted =
      writer_.addMetadata("tenon outcome", {{"reason", run.reason},
                                            {"tick", std::to_string(run.tick)},
                                            {"final hash", fmt::format("{:016x}", run.final_hash)}});
  if (!noted) return noted;
  return writer_.close();
}

Result<RerunReport> rerun(const std::filesystem::path& file, Exercise& exercise) {
  auto reader = McapReader::open(file);
  if (!reader) return fail(reader.error().what);
  Rerunner rerunner(exercise);
  McapMessage message;
  while (reader->next(message))
    if (auto read = rerunner.read(message); !read)
      return fail(fmt::format("{}: {}", file.string(), read.error().what));
  RerunReport report = rerunner.report();
  report.problem = reader->problem();
  if (report.compared > 0) return report;
  return fail(fmt::format("{}: holds no ticks to run again{}", file.string(),
                          report.problem.empty() ? " (was it recorded by 'tenon record' or 'tenon serve'?)"
                                                 : ": " + report.problem));
}

Result<Fingerprint> madeOf(const std::filesystem::path& file) {
  auto reader = McapReader::open(file);
  if (!reader) return fail(reader.error().what);
  Fingerprint made;
  for (const auto& [name, values] : reader->metadata()) {
    if (name != kMetadata && name != kRecordingMetadata) continue;
    for (const auto& [key, value] : values) {
      if (key == kScenarioHash) made.scenario = value;
      if (key.starts_with(kStructuresOf)) made.structures[key.substr(kStructuresOf.size())] = value;
    }
  }
  // a recorder has heard the scene before the first checkpoint, and nothing else tells it
  if (!made.structures.empty()) return made;
  for (McapMessage message; reader->next(message) && message.topic != kCheckpoint.name;) {
    if (message.topic != kSceneObject.name) continue;
    const auto object = decode<SceneObject>(message.data);
    if (object && !object->structure_hash.empty()) made.structures[object->name] = object->structure_hash;
  }
  return made;
}

Result<JournalOrigin> originOf(const std::filesystem::path& file) {
  auto reader = McapReader::open(file);
  if (!reader) return fail(reader.error().what);
  for (const auto& [name, values] : reader->metadata())
    if (name == kMetadata && values.contains("scenario") && values.contains("detail"))
      return JournalOrigin{values.at("scenario"), std::strtod(values.at("detail").c_str(), nullptr), {}};
  return fail(
      fmt::format("{}: does not say which scenario it was made with; name it before --rerun", file.string()));
}

}  // namespace tenon
