#include "server/session/journal.h"

#include <algorithm>
#include <cstdlib>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "idl/record/packed_inputs.h"
#include "idl/types/messages/journal.h"
#include "idl/types/messages/session.h"
#include "idl/wire/codec.h"
#include "idl/wire/topics.h"
#include "server/session/part_joiner.h"
#include "server/session/scenario_copy.h"

namespace tenon::session {
namespace {

constexpr std::string_view kMetadata = "tenon journal";
constexpr std::string_view kRecordingMetadata = "tenon recording";  // of `tenon record`
constexpr std::string_view kScenarioHash = "scenario hash";
constexpr std::string_view kStructuresOf = "structures of ";
constexpr std::string_view kProtocol = "protocol";
constexpr std::string_view kFreeze = "freeze after ticks";
constexpr std::string_view kPark = "park after ticks";
constexpr std::string_view kEpoch = "server epoch";
constexpr std::string_view kOutcome = "tenon outcome";  // as in recordings

/// A re-simulation in progress: restores checkpoints, applies inputs and compares hashes, message by message.
class Resimulator {
 public:
  /// `first`: the tick that the file begins with; 0: not known.
  Resimulator(SessionSimulation& simulation, Tick first) : simulation_(simulation), first_(first) {}

  Result<void> read(const record::McapMessage& message) {
    if (message.topic == wire::kTickInput.name) return readInput(message);
    if (message.topic == record::kPackedInputsTopic) return readPacked(message);
    if (message.topic == wire::kCheckpoint.name) return readCheckpoint(message);
    return {};
  }
  /// After the last message; `end`: the last tick of the run, none: not known.
  void finish(std::optional<Tick> end) {
    if (report_.reached != 0 && end && *end > report_.reached)
      report_.gaps.push_back({.first = report_.reached + 1, .last = *end, .is_at_end = true});
  }
  [[nodiscard]] const ResimulationReport& report() const { return report_; }

 private:
  Result<void> readInput(const record::McapMessage& message) {
    const auto part = wire::decode<TickInputPart>(message.data);
    if (!part) return fail(part.error().what);
    if (!inputs_.add(*part)) return {};
    auto input = readTickInput(inputs_.bytes());
    if (!input) return fail(input.error().what);
    return take({.input = std::move(*input), .hash = part->state_hash, .checkpoint = {}});
  }

  Result<void> readPacked(const record::McapMessage& message) {
    const auto packed = record::decodePackedInputs(message.data);
    if (!packed) return fail(packed.error().what);
    for (const record::RecordedInput& one : *packed) {
      auto input = readTickInput(one.bytes);
      if (!input) return fail(input.error().what);
      if (auto taken = take({.input = std::move(*input), .hash = one.state_hash, .checkpoint = {}}); !taken)
        return taken;
    }
    return {};
  }

  Result<void> take(JournalEntry entry) {
    noteMissingBefore(entry.input.tick);
    apply(std::move(entry));
    if (synchronized_ || !ahead_ || ahead_->tick <= simulation_.now()) return {};
    const Checkpoint next = *std::exchange(ahead_, std::nullopt);
    return restore(next.bytes);
  }

  /// By the ticks that the file has, whether they can be compared or not.
  void noteMissingBefore(Tick tick) {
    std::vector<JournalGap>& gaps = report_.gaps;
    // a resumed server has begun again: what its former life lacks from there on is not missing
    while (tick <= report_.reached && !gaps.empty() && gaps.back().first >= tick) gaps.pop_back();
    if (report_.reached != 0 && tick > report_.reached + 1)
      gaps.push_back({.first = report_.reached + 1, .last = tick - 1});
    report_.reached = tick;
  }

  [[nodiscard]] bool isMissing(Tick tick) const {
    return std::any_of(report_.gaps.begin(), report_.gaps.end(),
                       [&](const JournalGap& gap) { return gap.first <= tick && tick <= gap.last; });
  }

  void apply(JournalEntry entry) {
    const Tick expected = simulation_.now() + 1;
    if (synchronized_ && entry.input.tick < expected) return;
    if (synchronized_ && entry.input.tick > expected) {
      // inputs that waited too long for the checkpoint before them were given up
      if (!isMissing(expected)) report_.gaps.push_back({.first = expected, .last = entry.input.tick - 1});
      synchronized_ = false;
    }
    if (!synchronized_) {
      // ticks go back where a resumed server began again: what waits is of its former life
      if (!waiting_.empty() && entry.input.tick <= waiting_.back().input.tick) waiting_.clear();
      if (waiting_.size() >= kCheckpointEvery) waiting_.pop_front();
      return waiting_.push_back(std::move(entry));
    }
    simulation_.tick(entry.input);
    compare(entry.input.tick, entry.hash);
  }

  Result<void> readCheckpoint(const record::McapMessage& message) {
    const auto part = wire::decode<CheckpointPart>(message.data);
    if (!part) return fail(part.error().what);
    if (!checkpoints_.add(*part)) return {};
    if (!synchronized_) return restore(checkpoints_.bytes());
    // the inputs before it are missing, or on their way
    if (part->tick > simulation_.now())
      ahead_ = Checkpoint{part->tick, {checkpoints_.bytes().begin(), checkpoints_.bytes().end()}};
    return {};
  }

  /// Continues after a checkpoint.
  Result<void> restore(std::span<const std::uint8_t> checkpoint) {
    if (auto restored = simulation_.restore(checkpoint); !restored) return restored;
    const Tick now = simulation_.now();
    std::vector<JournalGap>& gaps = report_.gaps;
    if (const Tick first = std::exchange(first_, 0); first != 0 && now > first) {
      std::erase_if(gaps, [&](const JournalGap& gap) { return gap.last <= now; });
      gaps.insert(gaps.begin(), {.first = first, .last = now, .compared_after = now});
    }
    for (JournalGap& gap : gaps)
      if (gap.compared_after == 0 && gap.last <= now) gap.compared_after = now;
    synchronized_ = true;
    for (JournalEntry& entry : std::exchange(waiting_, {}))
      if (entry.input.tick > now) apply(std::move(entry));
    return {};
  }

  void compare(Tick tick, std::uint64_t hash) {
    if (report_.compared++ == 0) report_.first = tick;
    report_.last = tick;
    report_.final_hash = simulation_.hash();
    if (report_.final_hash != hash && !report_.first_difference) report_.first_difference = tick;
  }

  SessionSimulation& simulation_;
  Tick first_;  ///< that the file should have; 0: not known, or found
  PartJoiner<TickInputPart> inputs_;
  PartJoiner<CheckpointPart> checkpoints_;
  ResimulationReport report_;
  bool synchronized_ = false;  ///< the simulation is in the state after the last recorded tick
  /// The last inputs while it is not: DDS keeps the order within a topic, so that in a recording a checkpoint
  /// may follow inputs of later ticks.
  std::deque<JournalEntry> waiting_;
  struct Checkpoint {
    Tick tick = 0;
    std::vector<std::uint8_t> bytes;
  };
  /// The newest one of a later tick than the simulation's, for when it lacks the inputs up to there.
  std::optional<Checkpoint> ahead_;
};

/// By the outcome; none where the file has none, as of a server that was killed, or was closed before the
/// end.
std::optional<Tick> lastTickOfRun(const record::McapReader& reader) {
  std::optional<Tick> last;
  const auto [begin, end] = reader.metadata().equal_range(std::string(kOutcome));
  for (auto outcome = begin; outcome != end; ++outcome) {
    const auto& values = outcome->second;
    const auto tick = values.find("tick");
    const auto hash = values.find("final hash");
    if (tick == values.end() || hash == values.end()) continue;
    if (std::strtoull(hash->second.c_str(), nullptr, 16) == 0) continue;  // RunState: the run is not over
    last = std::max<Tick>(last.value_or(0), std::strtoull(tick->second.c_str(), nullptr, 10));
  }
  return last;
}

std::string nameTheScenario(const std::filesystem::path& file) {
  return fmt::format("name it as well, as in: tenon resimulate {} scenarios/engine_bay", file.string());
}

}  // namespace

Tick ResimulationReport::gapTicks() const {
  Tick ticks = 0;
  for (const JournalGap& gap : gaps) ticks += gap.last - gap.first + 1;
  return ticks;
}

Journal::Journal(record::McapWriter writer) : writer_(std::move(writer)) {
  input_channel_ =
      writer_.addChannel(wire::kTickInput.name, wire::typeName<TickInputPart>(), wire::idlText());
  checkpoint_channel_ =
      writer_.addChannel(wire::kCheckpoint.name, wire::typeName<CheckpointPart>(), wire::idlText());
}

Result<Journal> Journal::open(const std::filesystem::path& file, const JournalOrigin& origin) {
  auto writer = record::McapWriter::open(file);
  if (!writer) return fail(writer.error().what);
  Journal journal(std::move(*writer));
  std::map<std::string, std::string> metadata{{"scenario", origin.scenario},
                                              {"detail", fmt::format("{}", origin.detail)},
                                              {std::string(kProtocol), std::to_string(kProtocolVersion)},
                                              {std::string(kFreeze), std::to_string(origin.limits.freeze)},
                                              {std::string(kPark), std::to_string(origin.limits.park)},
                                              {std::string(kEpoch), std::to_string(origin.server_epoch)},
                                              {std::string(kScenarioHash), origin.fingerprint.scenario}};
  for (const auto& [object, hash] : origin.fingerprint.structures)
    metadata[std::string(kStructuresOf) + object] = hash;
  const auto added = journal.writer_.addMetadata(kMetadata, metadata);
  if (!added) return fail(added.error().what);
  return journal;
}

Result<Journal> Journal::reopen(const std::filesystem::path& file, Tick tick, std::uint32_t server_epoch) {
  auto writer = record::McapWriter::reopen(file);
  if (!writer) return fail(writer.error().what);
  Journal journal(std::move(*writer));
  const auto noted = journal.writer_.addMetadata(
      "tenon resumed",
      {{"after tick", std::to_string(tick)}, {std::string(kEpoch), std::to_string(server_epoch)}});
  if (!noted) return fail(noted.error().what);
  return journal;
}

Result<void> Journal::copyScenario(const game_control::ScenarioFile& scenario) {
  return addScenarioFiles(writer_, scenario);
}

Result<void> Journal::write(const JournalEntry& entry) {
  Result<void> result;
  const auto log_time = static_cast<std::int64_t>(entry.input.tick) * kJournalTick;
  const auto put = [&](std::uint16_t channel, const auto& part) {
    const auto data = wire::encode(part);
    const auto done = data ? writer_.write(channel, log_time, part.part, *data) : fail(data.error().what);
    if (!done) result = done;
  };
  bytes_.clear();
  appendBytes(entry.input, bytes_);
  forEachPart<TickInputPart>(entry.input.tick, entry.hash, bytes_,
                             [&](const auto& part) { put(input_channel_, part); });
  if (!entry.checkpoint.empty())
    forEachPart<CheckpointPart>(entry.input.tick, entry.hash, entry.checkpoint,
                                [&](const auto& part) { put(checkpoint_channel_, part); });
  return result;
}

Result<void> Journal::close(const RunState& run) {
  const auto added = writer_.addMetadata(kOutcome, {{"reason", run.reason},
                                                    {"tick", std::to_string(run.tick)},
                                                    {"final hash", fmt::format("{:016x}", run.final_hash)}});
  if (!added) return added;
  return writer_.close();
}

Result<ResimulationReport> resimulate(const std::filesystem::path& file, SessionSimulation& simulation) {
  auto reader = record::McapReader::open(file);
  if (!reader) return fail(reader.error().what);
  if (const std::string why = refusalByProtocol(*reader); !why.empty())
    return fail(file.string() + ": " + why);
  // a recorder may come late, a journal begins with the session
  const bool is_journal = reader->metadata().contains(std::string(kMetadata));
  Resimulator resimulator(simulation, is_journal ? 1 : 0);
  record::McapMessage message;
  while (reader->next(message))
    if (auto read = resimulator.read(message); !read)
      return fail(fmt::format("{}: {}", file.string(), read.error().what));
  const std::optional<Tick> end = lastTickOfRun(*reader);
  resimulator.finish(end);
  ResimulationReport report = resimulator.report();
  report.is_journal = is_journal;
  report.has_no_end = !end && (is_journal || !reader->complete());
  report.problem = reader->problem();
  report.is_damaged = reader->isDamaged();
  if (report.compared > 0) return report;
  return fail(fmt::format("{}: holds no ticks to re-simulate{}", file.string(),
                          report.problem.empty() ? " (was it recorded by 'tenon record' or 'tenon serve'?)"
                                                 : ": " + report.problem));
}

std::string refusalByProtocol(const record::McapReader& reader) {
  for (const auto& [name, values] : reader.metadata()) {
    if (name != kMetadata && name != kRecordingMetadata) continue;
    const auto found = values.find(std::string(kProtocol));
    const std::string version = found == values.end() ? "3 or older" : found->second;
    if (version != std::to_string(kProtocolVersion))
      return fmt::format("was written with version {} of the protocol, this program reads version {}",
                         version, kProtocolVersion);
  }
  return {};
}

Result<Fingerprint> readFingerprint(const std::filesystem::path& file) {
  auto reader = record::McapReader::open(file);
  if (!reader) return fail(reader.error().what);
  Fingerprint fingerprint;
  for (const auto& [name, values] : reader->metadata()) {
    if (name != kMetadata && name != kRecordingMetadata) continue;
    for (const auto& [key, value] : values) {
      if (key == kScenarioHash) fingerprint.scenario = value;
      if (key.starts_with(kStructuresOf)) fingerprint.structures[key.substr(kStructuresOf.size())] = value;
    }
  }
  // a recording has the structure hashes only in its SceneObject samples, which precede the first checkpoint
  if (!fingerprint.structures.empty()) return fingerprint;
  for (record::McapMessage message; reader->next(message) && message.topic != wire::kCheckpoint.name;) {
    if (message.topic != wire::kSceneObject.name) continue;
    const auto object = wire::decode<SceneObject>(message.data);
    if (object && !object->structure_hash.empty())
      fingerprint.structures[object->name] = object->structure_hash;
  }
  return fingerprint;
}

std::uint32_t lastServerEpoch(const std::filesystem::path& journal) {
  const auto reader = record::McapReader::open(journal);
  if (!reader) return 0;
  std::uint32_t last = 0;
  for (const auto& [name, values] : reader->metadata())
    if (const auto epoch = values.find(std::string(kEpoch)); epoch != values.end())
      last = std::max(last, static_cast<std::uint32_t>(std::strtoul(epoch->second.c_str(), nullptr, 10)));
  return last;
}

Result<JournalOrigin> readJournalOrigin(const std::filesystem::path& file) {
  auto reader = record::McapReader::open(file);
  if (!reader) return fail(reader.error().what);
  for (const auto& [name, values] : reader->metadata())
    if ((name == kMetadata || name == kRecordingMetadata) && values.contains("scenario") &&
        values.contains("detail")) {
      JournalOrigin origin{
          .scenario = values.at("scenario"),
          .detail = std::strtod(values.at("detail").c_str(), nullptr),
      };
      const auto limit = [&values](std::string_view key, Tick& ticks) {
        if (const auto found = values.find(std::string(key)); found != values.end())
          ticks = std::strtoull(found->second.c_str(), nullptr, 10);
      };
      limit(kFreeze, origin.limits.freeze);
      limit(kPark, origin.limits.park);
      return origin;
    }
  return fail(file.string() + ": does not name its scenario");
}

Result<std::filesystem::path> findScenario(const std::filesystem::path& journal,
                                           const JournalOrigin& origin) {
  std::error_code ignored;
  std::vector<std::filesystem::path> paths{origin.scenario, journal.parent_path() / origin.scenario};
  if (const char* const share = std::getenv("TENON_SHARE"); share != nullptr)  // set by `tenon`
    paths.push_back(std::filesystem::path(share) / "scenarios" / scenarioName(origin.scenario));
  for (const std::filesystem::path& path : paths)
    if (std::filesystem::exists(path, ignored)) return path;
  return fail(fmt::format(
      "{}: was recorded with the scenario '{}', which is neither below this folder nor below that "
      "of the file, nor a shipped one; {}",
      journal.string(), origin.scenario, nameTheScenario(journal)));
}

std::string scenarioName(const std::filesystem::path& scenario) {
  const std::filesystem::path path = scenario.lexically_normal();
  const bool is_of_folder = path.filename() == "scenario.yaml" || !path.has_filename();
  const std::filesystem::path named = is_of_folder ? path.parent_path().filename() : path.filename();
  return named.empty() ? std::filesystem::absolute(path).parent_path().filename() : named;
}

}  // namespace tenon::session
