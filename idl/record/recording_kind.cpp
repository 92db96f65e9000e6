#include "idl/record/recording_kind.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "idl/record/mcap_chunk.h"
#include "idl/record/mcap_index.h"

namespace tenon::record {

namespace {

constexpr std::string_view kOwnTypes = "tenon";
/// Of a journal, which a recording has as well.
constexpr std::string_view kInputs = "TickInput", kCheckpoints = "Checkpoint";

}  // namespace

std::string refusalOfKind(const McapReader& reader, const std::filesystem::path& file) {
  const auto isOwn = [](const McapChannel& channel) { return channel.type_name.starts_with(kOwnTypes); };
  const auto isOfJournal = [](const McapChannel& channel) {
    return channel.topic == kInputs || channel.topic == kCheckpoints;
  };
  const auto& channels = reader.channels();
  if (channels.empty())
    return file.string() + (reader.complete() ? ": holds no messages"
                                              : ": was cut off so soon that nothing of it can be read");
  if (std::none_of(channels.begin(), channels.end(), isOwn))
    return file.string() + ": is no recording of a session: what it holds was written by something else";
  if (std::all_of(channels.begin(), channels.end(), isOfJournal))
    return file.string() + ": is the journal of a server, which has no poses: `tenon resimulate " +
           file.string() + "` runs it again; reports and the player need what `tenon record` writes";
  return {};
}

Result<std::string> checkPlayable(const std::filesystem::path& file, const std::atomic<bool>& stop,
                                  const std::function<void(double)>& progress) {
  const auto reader = McapReader::open(file);
  if (!reader) return fail(reader.error().what);
  if (std::string refusal = refusalOfKind(*reader, file); !refusal.empty()) return fail(std::move(refusal));
  const auto refuse = [&file](const std::string& why) {
    return fail(file.string() + ": " + why + ", so it cannot be played; `tenon report " + file.string() +
                "` reads what is whole");
  };
  if (!reader->complete()) return refuse("was cut off before its end and has no index");
  mcap::MappedFile mapped;
  const auto bytes = mapped.map(file);
  if (!bytes) return fail(bytes.error().what);
  const mcap::IndexFindings findings = mcap::checkIndex(*bytes, stop, progress);
  if (!findings.problem.empty()) return refuse(findings.problem);
  std::string remark = reader->problem();
  if (findings.skipped > 0)
    remark += (remark.empty() ? file.string() + ": " : "; ") + std::to_string(findings.skipped) +
              " of its chunks are not in its index and are not played";
  return remark;
}

}  // namespace tenon::record
