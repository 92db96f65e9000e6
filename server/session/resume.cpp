#include "server/session/resume.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "idl/record/mcap_reader.h"
#include "idl/types/messages/journal.h"
#include "idl/wire/codec.h"
#include "idl/wire/topics.h"
#include "server/session/journal.h"
#include "server/session/part_joiner.h"

namespace tenon::session {
namespace {

/// Reads the end of a journal, message by message.
class TailReader {
 public:
  Result<void> read(const record::McapMessage& message) {
    if (message.topic == wire::kTickInput.name) return readInput(message);
    if (message.topic == wire::kCheckpoint.name) return readCheckpoint(message);
    return {};
  }
  /// Of ascending ticks, each with its checkpoint.
  std::vector<JournalEntry> entries;

  /// The newest entry that has a checkpoint; end(): none.
  [[nodiscard]] std::vector<JournalEntry>::const_iterator newestCheckpoint() const {
    const auto found = std::find_if(entries.rbegin(), entries.rend(),
                                    [](const JournalEntry& entry) { return !entry.checkpoint.empty(); });
    return found == entries.rend() ? entries.end() : std::prev(found.base());
  }

 private:
  Result<void> readInput(const record::McapMessage& message) {
    const auto part = wire::decode<TickInputPart>(message.data);
    if (!part) return fail(part.error().what);
    if (!inputs_.add(*part)) return {};
    auto input = readTickInput(inputs_.bytes());
    if (!input) return fail(input.error().what);
    // ticks go back where a resumed server began again: what it computed counts
    while (!entries.empty() && entries.back().input.tick >= input->tick) entries.pop_back();
    entries.push_back({.input = *input, .hash = part->state_hash, .checkpoint = {}});
    return {};
  }
  Result<void> readCheckpoint(const record::McapMessage& message) {
    const auto part = wire::decode<CheckpointPart>(message.data);
    if (!part) return fail(part.error().what);
    if (checkpoints_.add(*part) && !entries.empty() && entries.back().input.tick == part->tick)
      entries.back().checkpoint.assign(checkpoints_.bytes().begin(), checkpoints_.bytes().end());
    return {};
  }

  PartJoiner<TickInputPart> inputs_;
  PartJoiner<CheckpointPart> checkpoints_;
};

/// The ticks that recorders may lack, and those since the last checkpoint, which are more where the disk was
/// too slow for checkpoints.
Result<TailReader> readTail(record::McapReader& reader) {
  const std::int64_t end = reader.lastTime();
  for (std::int64_t span = static_cast<std::int64_t>(kKeptForRecorders) * kJournalTick;; span *= 8) {
    reader.seek(end - span);
    TailReader tail;
    record::McapMessage message;
    while (reader.next(message))
      if (auto read = tail.read(message); !read) return fail(read.error().what);
    if (tail.newestCheckpoint() != tail.entries.end() || span > end) return tail;
  }
}

std::string instead(const std::filesystem::path& file) {
  return fmt::format("start a new session with --journal and another name than {}", file.filename().string());
}

/// Why the session of this journal cannot be taken up by a server of `loaded`; empty: it can.
std::string refusal(const std::filesystem::path& file, const record::McapReader& reader,
                    const LoadedScene& loaded) {
  const auto& metadata = reader.metadata();
  if (!metadata.contains("tenon journal"))
    return "names no scenario: it is cut near its begin, or no journal of 'tenon serve --journal'; " +
           instead(file);
  if (const auto outcome = metadata.find("tenon outcome"); outcome != metadata.end())
    return fmt::format("the session has ended ('{}', tick {}), there is nothing to resume; {}",
                       outcome->second.contains("reason") ? outcome->second.at("reason") : "",
                       outcome->second.contains("tick") ? outcome->second.at("tick") : "?", instead(file));
  if (reader.complete()) return "was closed, there is nothing to resume; " + instead(file);
  if (const std::string why = refusalByProtocol(reader); !why.empty()) return why + "; " + instead(file);
  const auto then = readFingerprint(file);
  if (!then) return then.error().what;
  if (const auto changes = changesSince(*then, loaded); !changes.empty())
    return fmt::format(
        "was written with another scenario than {} is now (changed: {}): resume it with the one it "
        "was written with, '{}', or {}",
        loaded.scenario->path.string(), fmt::join(changes, ", "),
        readJournalOrigin(file).value_or(JournalOrigin{}).scenario, instead(file));
  return {};
}

}  // namespace

Result<ResumePoint> readResumePoint(const std::filesystem::path& journal, const LoadedScene& loaded,
                                    SessionSimulation& simulation) {
  const auto failed = [&](const std::string& what) {
    return fail(fmt::format("{}: {}", journal.string(), what));
  };
  auto reader = record::McapReader::open(journal);
  if (!reader) return fail(reader.error().what);
  if (const std::string why = refusal(journal, *reader, loaded); !why.empty()) return failed(why);
  auto tail = readTail(*reader);
  if (!tail) return failed(fmt::format("{}; {}", tail.error().what, instead(journal)));
  // killed while it still waited for people
  if (reader->lastTime() == 0 && reader->channels().size() >= 2) return ResumePoint{};
  const auto newest = tail->newestCheckpoint();
  if (newest == tail->entries.end())
    return failed("holds no checkpoint to resume from, so the file is damaged or cut; " + instead(journal));
  if (auto restored = simulation.restore(newest->checkpoint); !restored)
    return failed(fmt::format("{}; {}", restored.error().what, instead(journal)));
  ResumePoint point{.tick = simulation.now(), .checkpoint = simulation.now(), .problem = {}, .entries = {}};
  if (reader->isDamaged())
    point.problem = reader->problem() + "; the session continues after the last chunk that can be read";
  auto entry = std::next(newest);
  for (; entry != tail->entries.end(); ++entry) {
    if (entry->input.tick != simulation.now() + 1) {
      point.problem =
          fmt::format("{} has no tick {}, so the session continues from there, {} ticks before its end",
                      point.problem.empty() ? journal.string() + ":" : point.problem + "; it",
                      simulation.now() + 1, tail->entries.back().input.tick - simulation.now());
      break;
    }
    simulation.tick(entry->input);
    if (simulation.hash() != entry->hash)
      return failed(fmt::format(
          "tick {} has another result here than the server had that wrote it: resume with the same build of "
          "tenon, or {}",
          simulation.now(), instead(journal)));
  }
  tail->entries.erase(entry, tail->entries.end());
  point.entries = std::move(tail->entries);
  point.tick = simulation.now();
  return point;
}

}  // namespace tenon::session
