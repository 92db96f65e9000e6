#include "idl/record/mcap_sequence.h"

#include <algorithm>

#include "idl/record/mcap_chunk.h"
#include "idl/record/mcap_format.h"

namespace tenon::record::mcap {
namespace {

using Fields = std::span<const std::uint8_t>;

constexpr std::size_t kFooterBytes = 8 + 8 + 4;

/// [bytes] of a file from where on it has nothing but zeros.
std::size_t beginOfZeros(Fields file) {
  const auto last = std::find_if(file.rbegin(), file.rend(), [](std::uint8_t byte) { return byte != 0; });
  return static_cast<std::size_t>(file.rend() - last);
}

/// Whether a map consists of pairs of texts; `pairs`: those that were followed.
bool areTexts(FieldReader in, std::uint64_t& pairs) {
  for (; in.ok && !in.rest.empty(); ++pairs) in.text(), in.text();
  return in.ok;
}

/// Takes a list of entries of `entry` [bytes].
bool isListOf(std::uint32_t entry, FieldReader& in) {
  const auto size = in.get<std::uint32_t>();
  in.take(size);
  return size % entry == 0;
}

/// Of records that hold no maps, whether their fields end where they end.
bool endsWithItsFields(std::uint8_t opcode, Fields fields) {
  FieldReader in(fields);
  bool fits = true;
  switch (opcode) {
    case kHeader:
      in.text(), in.text();
      break;
    case kFooter:
      in.take(kFooterBytes);
      break;
    case kSchema:
      in.take(2), in.text(), in.text(), in.text();
      break;
    case kChunk:
      in.take(8 + 8 + 8 + 4), in.text(), in.take(in.get<std::uint64_t>());
      break;
    case kMessageIndex:
      in.take(2), fits = isListOf(16, in);
      break;
    case kChunkIndex:
      in.take(8 + 8 + 8 + 8), fits = isListOf(10, in), in.take(8), in.text(), in.take(8 + 8);
      break;
    case kAttachment:
      in.take(8 + 8), in.text(), in.text(), in.take(in.get<std::uint64_t>()), in.take(4);
      break;
    case kAttachmentIndex:
      in.take(8 + 8 + 8 + 8 + 8), in.text(), in.text();
      break;
    case kStatistics:
      in.take(8 + 2 + 4 + 4 + 4 + 4 + 8 + 8), fits = isListOf(10, in);
      break;
    case kMetadataIndex:
      in.take(8 + 8), in.text();
      break;
    case kSummaryOffset:
      in.take(1 + 8 + 8);
      break;
    case kDataEnd:
      in.take(4);
      break;
    default:
      return false;  // a message outside of a chunk, or of no version of the format
  }
  return fits && in.ok && in.rest.empty();
}

/// Metadata of other programs have no checksum.
bool agreesWithChecksum(Fields metadata) {
  FieldReader in(metadata);
  const std::string title(in.text());
  auto values = in.values();
  return takeChecksum(title, values);
}

}  // namespace

RecordSequence::RecordSequence(Fields file)
    : file_(file),
      zeros_(beginOfZeros(file)),
      end_(sizeof(kMagic)),
      budget_(4 * file.size() + (std::uint64_t{16} << 20U)) {}

bool RecordSequence::next(std::uint8_t& opcode, Fields& fields) {
  unreadable_.reset();
  std::size_t at = end_;
  if (!take(at, opcode, fields)) {
    const auto found = search(at + 1);
    if (!found) {
      has_damaged_end_ = !isTornAt(at);
      return false;
    }
    unreadable_ = {at, *found};
    at = *found;
    take(at, opcode, fields);
  }
  begin_ = at;
  end_ = at + kRecordHeaderBytes + fields.size();
  return true;
}

bool RecordSequence::take(std::size_t at, std::uint8_t& opcode, Fields& fields) {
  auto rest = file_.subspan(at);
  if (!takeRecord(rest, opcode, fields) || !agrees(opcode, fields)) return false;
  if (opcode == kFooter) return rest.size() == sizeof(kMagic) && beginsWithMagic(rest);
  // a power failure leaves zeros where the end was not written yet
  const std::size_t end = file_.size() - rest.size();
  if (end > zeros_ && opcode == kChunk) return isWholeChunk(fields);
  if (end > zeros_ && opcode == kAttachment) return hasItsChecksum(fields);
  if (end > zeros_ && opcode == kMetadata && !agreesWithChecksum(fields)) return false;
  constexpr std::size_t kZeros = 8;  // [bytes] as no metadata ends
  return end < zeros_ + kZeros || opcode != kMetadata;
}

bool RecordSequence::agrees(std::uint8_t opcode, Fields fields) {
  if (opcode != kChannel && opcode != kMetadata) return endsWithItsFields(opcode, fields);
  FieldReader in(fields);
  if (opcode == kChannel) in.take(2 + 2), in.text();
  in.text();
  const Fields map = in.take(in.get<std::uint32_t>());
  std::uint64_t pairs = 0;
  const bool fits = in.ok && in.rest.empty() && areTexts(FieldReader(map), pairs);
  if (!fits) spend(8 * pairs);
  return fits;
}

/// Only a checksum tells a chunk from bytes that look like one.
bool RecordSequence::isWholeChunk(Fields fields) {
  FieldReader in(fields);
  in.take(8 + 8 + 8);
  plain_.clear();
  const bool is_whole = in.get<std::uint32_t>() != 0 && openChunk(fields, plain_).empty();
  if (!is_whole) spend(std::max<std::uint64_t>(plain_.size(), fields.size()));
  return is_whole;
}

bool RecordSequence::hasItsChecksum(Fields attachment) {
  std::uint32_t crc = 0;
  const Fields covered = attachment.first(attachment.size() - sizeof(crc));
  std::memcpy(&crc, attachment.data() + covered.size(), sizeof(crc));
  const bool has_it = crc == crc32(covered);
  if (!has_it) spend(covered.size());
  return has_it;
}

bool RecordSequence::isRecordAt(std::size_t at) {
  std::uint8_t opcode = 0;
  Fields fields;
  return take(at, opcode, fields);
}

/// Whether the file ends within a record that begins here, as it does when its program was killed.
bool RecordSequence::isTornAt(std::size_t at) const {
  if (at >= zeros_ || zeros_ - at < kRecordHeaderBytes) return true;
  FieldReader in(file_.subspan(at, zeros_ - at));
  const auto opcode = in.get<std::uint8_t>();
  const auto length = in.get<std::uint64_t>();
  const std::size_t after = zeros_ - at - kRecordHeaderBytes;
  if (opcode == kFooter && length == kFooterBytes) return after < length + sizeof(kMagic);
  if (opcode == 0 || opcode > kDataEnd || length <= after) return false;
  constexpr std::uint64_t kMostBesides = std::uint64_t{64} << 20U;  // [bytes] of a record that is no chunk
  if (opcode != kChunk) return opcode == kAttachment || length <= kMostBesides;
  constexpr std::size_t kBeforeName = 8 + 8 + 8 + 4;
  in.take(kBeforeName);
  const auto name = in.get<std::uint32_t>();
  in.take(name);
  const auto compressed = in.get<std::uint64_t>();
  // all of that precedes the compressed messages, of which some are not there
  return !in.ok || length == kBeforeName + sizeof(name) + name + sizeof(compressed) + compressed;
}

/// Whether a search ends here. What has no checksum has to be followed by another record.
bool RecordSequence::isFoundAt(std::size_t at) {
  std::uint8_t opcode = file_[at];
  if (opcode != kChunk && opcode != kAttachment && opcode != kMetadata && opcode != kDataEnd &&
      opcode != kFooter)
    return false;
  Fields fields;
  if (!take(at, opcode, fields)) return false;
  if (opcode == kChunk) return isWholeChunk(fields);
  if (opcode == kAttachment) return hasItsChecksum(fields);
  if (opcode == kFooter || isRecordAt(at + kRecordHeaderBytes + fields.size())) return true;
  spend(fields.size());
  return false;
}

std::optional<std::size_t> RecordSequence::search(std::size_t from) {
  for (std::size_t at = from; at < zeros_ && !has_given_up_; ++at)
    if (isFoundAt(at)) return at;
  return std::nullopt;
}

void RecordSequence::spend(std::uint64_t bytes) {
  has_given_up_ = has_given_up_ || bytes > budget_;
  budget_ -= std::min(budget_, bytes);
}

}  // namespace tenon::record::mcap
