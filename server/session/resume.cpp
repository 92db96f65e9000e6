#include "server/session/resume.h"

#include <cstdint>
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

/// The last checkpoint of a journal and the inputs after it.
struct Tail {
  std::vector<std::uint8_t> checkpoint;  ///< empty: none
  std::vector<JournalEntry> entries;
};

/// Follows the messages of a journal in their order.
class TailReader {
 public:
  Result<void> read(const record::McapMessage& message) {
    if (message.topic == wire::kTickInput.name) return readInput(message);
    if (message.topic == wire::kCheckpoint.name) return readCheckpoint(message);
    return {};
  }
  Tail tail;

 private:
  Result<void> readInput(const record::McapMessage& message) {
    const auto part = wire::decode<TickInputPart>(message.data);
    if (!part) return fail(part.error().what);
    if (!inputs_.add(*part) || tail.checkpoint.empty()) return {};
    auto input = readTickInput(inputs_.bytes());
    if (!input) return fail(input.error().what);
    tail.entries.push_back({.input = *input, .hash = part->state_hash, .checkpoint = {}});
    return {};
  }
  Result<void> readCheckpoint(const record::McapMessage& message) {
    const auto part = wire::decode<CheckpointPart>(message.data);
    if (!part) return fail(part.error().what);
    if (!checkpoints_.add(*part)) return {};
    tail.checkpoint.assign(checkpoints_.bytes().begin(), checkpoints_.bytes().end());
    tail.entries.clear();
    return {};
  }

  PartJoiner<TickInputPart> inputs_;
  PartJoiner<CheckpointPart> checkpoints_;
};

/// From a little more than the last checkpoint period on, and from further back where that has no checkpoint.
Result<Tail> readTail(record::McapReader& reader) {
  const std::int64_t end = reader.lastTime();
  for (std::int64_t span = 2 * static_cast<std::int64_t>(kCheckpointEvery) * kJournalTick;; span *= 8) {
    reader.seek(end - span);
    TailReader tail;
    record::McapMessage message;
    while (reader.next(message))
      if (auto read = tail.read(message); !read) return fail(read.error().what);
    if (!tail.tail.checkpoint.empty() || span > end) return std::move(tail.tail);
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
  if (tail->checkpoint.empty())
    return failed("holds no checkpoint to resume from, so the file is damaged or cut; " + instead(journal));
  if (auto restored = simulation.restore(tail->checkpoint); !restored)
    return failed(fmt::format("{}; {}", restored.error().what, instead(journal)));
  ResumePoint point{.tick = simulation.now(), .checkpoint = simulation.now(), .problem = {}, .entries = {}};
  for (JournalEntry& entry : tail->entries) {
    if (entry.input.tick != simulation.now() + 1) {
      point.problem = fmt::format(
          "{}: has no tick {}, so the session continues from there, {} ticks before its end", journal.string(),
          simulation.now() + 1, tail->entries.back().input.tick - simulation.now());
      break;
    }
    simulation.tick(entry.input);
    if (simulation.hash() != entry.hash)
      return failed(fmt::format(
          "tick {} has another result here than the server had that wrote it: resume with the same build of "
          "tenon, or {}",
          simulation.now(), instead(journal)));
    point.entries.push_back(std::move(entry));
  }
  point.tick = simulation.now();
  return point;
}

}  // namespace tenon::session
