#include "idl/record/mcap_index.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "idl/record/mcap_chunk.h"
#include "idl/record/mcap_format.h"
#include "idl/record/mcap_sequence.h"

namespace tenon::record::mcap {
namespace {

using Content = std::span<const std::uint8_t>;

struct Record {
  std::uint8_t opcode = 0;
  std::size_t begin = 0, end = 0;  // [bytes]
  Content fields;
};

class Index {
 public:
  explicit Index(Content file) : file_(file) {
    RecordSequence records(file);
    Record record;
    while (records.next(record.opcode, record.fields)) {
      record.begin = records.begin();
      record.end = records.end();
      if (summary_ == 0)
        data_.emplace(record.begin, record);
      else
        indices_.push_back(record);
      if (record.opcode == kDataEnd) summary_ = record.end;
    }
  }

  [[nodiscard]] IndexFindings check(const std::atomic<bool>& stop, const CheckProgress& progress) {
    if (!hasSummary()) return {"the summary at its end, which says where everything is, is damaged"};
    std::set<std::uint64_t> known;
    std::size_t wrong = 0;
    std::string first;
    for (const Record& index : indices_) {
      if (stop) return {};
      FieldReader in(index.fields);
      if (index.opcode == kMetadataIndex) {
        const auto begin = in.get<std::uint64_t>(), length = in.get<std::uint64_t>();
        if (!isAt(kMetadata, begin, length)) return {"its metadata are not where its index says"};
      }
      if (index.opcode != kChunkIndex) continue;
      in.take(8 + 8);
      const auto begin = in.get<std::uint64_t>(), length = in.get<std::uint64_t>();
      known.insert(begin);
      const bool is_whole = isAt(kChunk, begin, length) && agrees(index.fields);
      if (!is_whole && wrong++ == 0) first = std::to_string(begin) + " to " + std::to_string(begin + length);
      if (progress)
        progress(std::min(1.0, static_cast<double>(begin + length) / static_cast<double>(file_.size())));
    }
    IndexFindings findings;
    if (wrong > 0)
      findings.problem = std::to_string(wrong) + " of its " + std::to_string(known.size()) +
                         " chunks are damaged or not where its index says, the first in bytes " + first;
    findings.skipped =
        static_cast<std::size_t>(std::count_if(data_.begin(), data_.end(), [&](const auto& record) {
          return record.second.opcode == kChunk && !known.contains(record.first);
        }));
    return findings;
  }

 private:
  /// Where the footer says, and undamaged.
  [[nodiscard]] bool hasSummary() const {
    if (summary_ == 0 || indices_.empty() || indices_.back().opcode != kFooter) return false;
    const Record& footer = indices_.back();
    FieldReader in(footer.fields);
    const auto begin = in.get<std::uint64_t>();
    in.take(8);
    const auto crc = in.get<std::uint32_t>();
    const auto covered = file_.subspan(summary_, footer.end - sizeof(crc) - summary_);
    return begin == summary_ && (crc == 0 || crc == crc32(covered));
  }
  [[nodiscard]] bool isAt(Opcode opcode, std::uint64_t begin, std::uint64_t length) const {
    const auto found = data_.find(begin);
    return found != data_.end() && found->second.opcode == opcode && found->second.end - begin == length;
  }
  /// Whether a chunk can be opened and has what its index and its message indices say. Precondition: it is
  /// there.
  [[nodiscard]] bool agrees(Content chunk_index) {
    FieldReader in(chunk_index);
    const TimeRange said{in.get<std::int64_t>(), in.get<std::int64_t>()};
    const Record& chunk = data_.find(in.get<std::uint64_t>())->second;
    in.take(8);
    FieldReader offsets(in.take(in.get<std::uint32_t>()));
    const std::uint64_t indices_end = chunk.end + in.get<std::uint64_t>();
    if (!openChunk(chunk.fields, plain_).empty()) return false;
    std::optional<TimeRange> times;
    while (offsets.ok && !offsets.rest.empty()) {
      const auto channel = offsets.get<std::uint16_t>();
      const auto found = data_.find(offsets.get<std::uint64_t>());
      if (found == data_.end() || found->second.opcode != kMessageIndex) return false;
      const Record& index = found->second;
      const bool is_of_chunk = index.begin >= chunk.end && index.end <= indices_end;
      if (!is_of_chunk || !hasMessages(index.fields, channel, times)) return false;
    }
    return !times || times == said;
  }
  /// Whether the chunk that is open has the messages of a message index, whose times are added to `times`.
  [[nodiscard]] bool hasMessages(Content message_index, std::uint16_t channel,
                                 std::optional<TimeRange>& times) const {
    FieldReader in(message_index);
    if (in.get<std::uint16_t>() != channel) return false;
    FieldReader entries(in.take(in.get<std::uint32_t>()));
    while (entries.ok && !entries.rest.empty()) {
      const auto time = entries.get<std::int64_t>();
      const auto offset = entries.get<std::uint64_t>();
      if (offset > plain_.size()) return false;
      Content rest = Content(plain_).subspan(offset), fields;
      std::uint8_t opcode = 0;
      if (!takeRecord(rest, opcode, fields) || opcode != kMessage) return false;
      FieldReader message(fields);
      const bool is_of_channel = message.get<std::uint16_t>() == channel;
      message.take(4);
      if (!is_of_channel || message.get<std::int64_t>() != time) return false;
      if (!times) times = {time, time};
      times = {std::min(times->first, time), std::max(times->last, time)};
    }
    return in.ok && entries.ok;
  }

  Content file_;
  std::map<std::size_t, Record> data_;  ///< by its begin
  std::vector<Record> indices_;         ///< after the data, with the footer
  std::size_t summary_ = 0;             ///< [bytes] where it begins; 0: there is none
  std::vector<std::uint8_t> plain_;     ///< of a chunk
};

}  // namespace

IndexFindings checkIndex(std::span<const std::uint8_t> file, const std::atomic<bool>& stop,
                         const CheckProgress& progress) {
  return Index(file).check(stop, progress);
}

}  // namespace tenon::record::mcap
