#include <algorithm>
#include <cstring>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/record/compression.h"
#include "tests/idl/record/mcap_fixture.h"
#include "tests/support/file_damage.h"

namespace tenon::record {
namespace {

using testing::HasSubstr;

TEST_F(McapTest, TruncatedAtAnyByteItHasAllCompleteChunksAndReportsTheTruncation) {
  const auto written = record(20);
  const Bytes whole = fileBytes();
  std::size_t before = 0;
  for (std::size_t size = 0; size < whole.size(); ++size) {
    writeFile(std::span(whole).first(size));
    auto reader = McapReader::open(file_);
    if (!reader) {
      EXPECT_LT(size, sizeof(mcap::kMagic));
      EXPECT_THAT(reader.error().what, HasSubstr(file_.string()));
      continue;
    }
    ASSERT_FALSE(reader->complete()) << size;
    ASSERT_THAT(reader->problem(), HasSubstr("is truncated")) << size;
    ASSERT_FALSE(reader->isDamaged()) << size << ": " << reader->problem();
    const auto read = readAll(*reader);
    ASSERT_LE(read.size(), written.size());
    ASSERT_TRUE(std::equal(read.begin(), read.end(), written.begin())) << size;
    ASSERT_GE(read.size(), before) << "more bytes give no fewer messages";
    before = read.size();
  }
  EXPECT_EQ(before, written.size());
}

TEST_F(McapTest, AFlippedBitNeverChangesAMessageAndNeverCrashes) {
  const auto written = record(40);
  const Bytes whole = fileBytes();
  std::mt19937_64 random(11);
  std::size_t read = 0;
  for (int round = 0; round < 1000; ++round) {
    Bytes bytes = whole;
    bytes[random() % bytes.size()] ^= static_cast<std::uint8_t>(1U << (random() % 8));
    writeFile(bytes);
    auto reader = McapReader::open(file_);
    if (!reader) continue;
    for (const StoredMessage& message : readAll(*reader)) {
      const bool known = std::find(written.begin(), written.end(), message) != written.end();
      ASSERT_TRUE(known) << "round " << round;
      ++read;
    }
  }
  EXPECT_GT(read, 500 * written.size()) << "most of the messages are still there";
}

TEST_F(McapTest, ADamagedChunkIsSkippedAndReported) {
  record(40, false);
  Bytes bytes = fileBytes();
  // the first message of the third chunk, which is stored uncompressed
  std::size_t chunk = 0, at = sizeof(mcap::kMagic);
  for (int seen = 0; seen < 3;) {
    chunk = at;
    if (bytes[at] == mcap::kChunk) ++seen;
    std::uint64_t length = 0;
    std::memcpy(&length, bytes.data() + at + 1, sizeof length);
    at += mcap::kRecordHeaderBytes + length;
  }
  bytes[chunk + 100] ^= 1U;
  writeFile(bytes);
  auto reader = McapReader::open(file_);
  ASSERT_TRUE(reader);
  EXPECT_EQ(readAll(*reader).size(), 30U);
  EXPECT_THAT(reader->problem(), HasSubstr("checksum"));
}

TEST_F(McapTest, AfterALengthThatIsDamagedTheNextChunksAreRead) {
  for (const std::uint8_t damage : {1, 0x7f}) {  // into the chunk, and beyond the end of the file
    const auto written = record(40);
    Bytes bytes = fileBytes();
    std::size_t at = sizeof(mcap::kMagic);
    for (int seen = 0; seen < 2;) {
      if (bytes[at] == mcap::kChunk && ++seen == 2) break;
      std::uint64_t length = 0;
      std::memcpy(&length, bytes.data() + at + 1, sizeof length);
      at += mcap::kRecordHeaderBytes + length;
    }
    if (damage == 1) bytes[at + 1] ^= damage;
    if (damage != 1) bytes[at + 7] = damage;
    writeFile(bytes);
    auto reader = McapReader::open(file_);
    ASSERT_TRUE(reader);
    EXPECT_TRUE(reader->isDamaged());
    EXPECT_TRUE(reader->complete());
    EXPECT_THAT(reader->problem(), HasSubstr("is damaged between bytes "));
    const auto read = readAll(*reader);
    ASSERT_GE(read.size(), 30U);
    EXPECT_TRUE(std::equal(read.end() - 20, read.end(), written.end() - 20));
  }
}

TEST_F(McapTest, AFlippedBitInTheHeadOfARecordLosesNoMoreThanItsChunk) {
  const auto written = record(40);
  const Bytes whole = fileBytes();
  for (const Record& damaged : recordsOf(whole)) {
    if (damaged.opcode != mcap::kChunk && damaged.opcode != mcap::kMessageIndex) continue;
    for (std::size_t bit = 0; bit < 8 * mcap::kRecordHeaderBytes; ++bit) {
      SCOPED_TRACE("bit " + std::to_string(bit) + " of the record at byte " + std::to_string(damaged.begin));
      Bytes bytes = whole;
      bytes[damaged.begin + bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
      writeFile(bytes);
      auto reader = McapReader::open(file_);
      ASSERT_TRUE(reader);
      EXPECT_TRUE(reader->complete());
      EXPECT_THAT(reader->problem(), HasSubstr("is damaged between bytes " + std::to_string(damaged.begin)));
      EXPECT_EQ(reader->metadata().size(), 1U);
      EXPECT_EQ(reader->attachments().size(), 1U);
      EXPECT_EQ(readAll(*reader).size(), damaged.opcode == mcap::kChunk ? 30U : 40U);
    }
  }
}

// the last records are those before the end of the data: nothing is cut off, and what is added is read
TEST_F(McapTest, AFileThatIsContinuedAfterDamageHasAllThatIsAdded) {
  record(40);
  const Bytes left = unfinished(fileBytes());
  const auto records = recordsOf(left);
  for (const Record& damaged : records) {
    if (damaged.opcode != mcap::kChunk || damaged.begin == chunksOf(left).back().begin) continue;
    for (const std::uint8_t opcode : {0x02, 0x0F, 0x0C, 0x86}) {
      SCOPED_TRACE(std::to_string(opcode) + " at byte " + std::to_string(damaged.begin));
      Bytes bytes = left;
      bytes[damaged.begin] = opcode;
      writeFile(bytes);
      {
        auto writer = McapWriter::reopen(file_);
        ASSERT_TRUE(writer) << writer.error().what;
        ASSERT_TRUE(writer->write(writer->addChannel("A", "t::A", ""), 5000, 77, Bytes(5)));
        ASSERT_TRUE(writer->close());
      }
      auto reader = McapReader::open(file_);
      ASSERT_TRUE(reader);
      EXPECT_TRUE(reader->complete());
      EXPECT_TRUE(reader->isDamaged());
      const auto read = readAll(*reader);
      ASSERT_EQ(read.size(), 31U);
      EXPECT_EQ(read.back().sequence, 77U);
      EXPECT_EQ(read.back().topic, "A");
    }
  }
}

TEST_F(McapTest, ALastChunkThatIsDamagedStaysInAFileThatIsContinued) {
  record(40);
  Bytes left = unfinished(fileBytes());
  const Record last = chunksOf(left).back();
  left[(last.begin + 53 + last.end) / 2] ^= 0x5AU;  // behind its head
  writeFile(left);
  {
    auto writer = McapWriter::reopen(file_);
    ASSERT_TRUE(writer) << writer.error().what;
    ASSERT_TRUE(writer->write(writer->addChannel("A", "t::A", ""), 5000, 77, Bytes(5)));
    ASSERT_TRUE(writer->close());
  }
  const Bytes continued = fileBytes();
  ASSERT_GT(continued.size(), last.end);
  EXPECT_TRUE(
      std::equal(left.begin(), left.begin() + static_cast<std::ptrdiff_t>(last.end), continued.begin()));
  auto reader = McapReader::open(file_);
  ASSERT_TRUE(reader);
  EXPECT_TRUE(reader->complete());
  const auto read = readAll(*reader);
  ASSERT_EQ(read.size(), 31U);
  EXPECT_TRUE(reader->isDamaged());
  EXPECT_THAT(reader->problem(), HasSubstr(std::to_string(last.begin)));
  EXPECT_EQ(read.back().sequence, 77U);
}

TEST_F(McapTest, WithoutTheFirstChunkALaterOneDefinesTheChannels) {
  const auto written = record(40);
  Bytes bytes = unfinished(fileBytes());
  const Record first = chunksOf(bytes).front();
  std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(first.begin),
            bytes.begin() + static_cast<std::ptrdiff_t>(first.end), std::uint8_t{0x5A});
  writeFile(bytes);
  auto reader = McapReader::open(file_);
  ASSERT_TRUE(reader);
  ASSERT_EQ(reader->channels().size(), 2U);
  EXPECT_THAT(reader->channels()[1].schema_text, HasSubstr("struct B"));
  const auto read = readAll(*reader);
  ASSERT_EQ(read.size(), 30U);
  EXPECT_TRUE(std::equal(read.begin(), read.end(), written.begin() + 10));
  EXPECT_TRUE(McapWriter::reopen(file_)) << "and it can be continued";
}

TEST_F(McapTest, AllDamageIsNamedByItsBytesOrCounted) {
  record(80, false);
  Bytes bytes = unfinished(fileBytes());
  const auto chunks = chunksOf(bytes);
  for (std::size_t i = 2; i < 7; ++i) bytes[chunks[i].end - 1] ^= 1U;
  writeFile(bytes);
  auto reader = McapReader::open(file_);
  ASSERT_TRUE(reader);
  readAll(*reader);
  readAll(*reader);
  for (std::size_t i = 2; i < 5; ++i)
    EXPECT_THAT(reader->problem(), HasSubstr("a chunk (bytes " + std::to_string(chunks[i].begin) + " to " +
                                             std::to_string(chunks[i].end) + ") has a wrong checksum"));
  EXPECT_THAT(reader->problem(), HasSubstr("; 2 more places are damaged; is truncated"));
}

// as after a power failure
TEST_F(McapTest, ATornEndThatZerosFollowIsNoDamage) {
  record(20);
  const Bytes whole = fileBytes();
  const std::size_t last = chunksOf(whole).back().begin;
  for (std::size_t size = last; size < whole.size(); ++size) {
    Bytes bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    bytes.resize(size + 4096);
    writeFile(bytes);
    auto reader = McapReader::open(file_);
    ASSERT_TRUE(reader);
    ASSERT_GE(readAll(*reader).size(), 10U);
    ASSERT_FALSE(reader->isDamaged()) << size << ": " << reader->problem();
    ASSERT_FALSE(reader->complete()) << size;
  }
}

// nothing follows it by which it could be told from one that the end of the program has torn
TEST_F(McapTest, ADamagedLastChunkOfAKilledFileIsNoTornEnd) {
  record(20);
  const Bytes left = unfinished(fileBytes());
  const Record last = chunksOf(left).back();
  constexpr std::size_t kTimes = mcap::kRecordHeaderBytes;  // 16 bytes that no checksum covers
  for (std::size_t at = last.begin; at < last.end; ++at) {
    const bool is_of_times = at >= last.begin + kTimes && at < last.begin + kTimes + 16;
    for (unsigned bit = 0; bit < 8; ++bit) {
      Bytes bytes = left;
      bytes[at] ^= static_cast<std::uint8_t>(1U << bit);
      writeFile(bytes);
      auto reader = McapReader::open(file_);
      ASSERT_TRUE(reader);
      const std::size_t read = readAll(*reader).size();
      // zstd leaves some bits unused
      ASSERT_EQ(read, reader->isDamaged() && !is_of_times ? 10U : 20U)
          << "bit " << bit << " of byte " << at - last.begin;
      ASSERT_TRUE(reader->isDamaged() || !is_of_times) << "bit " << bit << " of byte " << at - last.begin;
    }
  }
}

// and it stays in the file, where it can be looked at: a kill leaves the begin of a chunk, and this is none
TEST_F(McapTest, ADamagedEndStaysInAFileThatIsContinued) {
  record(40);
  const Bytes whole = fileBytes();
  const Record last = chunksOf(whole).back();
  const auto after = [&] {
    for (const Record& next : recordsOf(whole))
      if (next.begin >= last.end && next.opcode != mcap::kMessageIndex) return next.begin;
    return whole.size();
  }();
  for (const std::size_t end : {last.end, after}) {
    for (const auto& [at, damage] : {std::pair{0, 0x86}, {0, 0x07}, {1, 0x5A}, {7, 0x7F}}) {
      SCOPED_TRACE(std::to_string(end) + ": byte " + std::to_string(at));
      Bytes left(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(end));
      left[last.begin + static_cast<std::size_t>(at)] ^= static_cast<std::uint8_t>(damage);
      writeFile(left);
      {
        auto writer = McapWriter::reopen(file_);
        ASSERT_TRUE(writer) << writer.error().what;
        ASSERT_TRUE(writer->write(writer->addChannel("A", "t::A", ""), 5000, 77, Bytes(5)));
        ASSERT_TRUE(writer->close());
      }
      const Bytes continued = fileBytes();
      ASSERT_GT(continued.size(), left.size());
      EXPECT_TRUE(std::equal(left.begin(), left.end(), continued.begin()));
      auto reader = McapReader::open(file_);
      ASSERT_TRUE(reader);
      EXPECT_TRUE(reader->complete());
      EXPECT_THAT(reader->problem(), HasSubstr("is damaged between bytes " + std::to_string(last.begin)));
      const auto read = readAll(*reader);
      ASSERT_EQ(read.size(), 31U);
      EXPECT_EQ(read.back().sequence, 77U);
    }
  }
}

// with an opcode of the format, and a length as none of its records has
TEST_F(McapTest, WhatFollowsAWholeFileAndIsNoRecordIsDamage) {
  record(20);
  const Bytes left = unfinished(fileBytes());
  for (const std::uint8_t opcode : {mcap::kStatistics, mcap::kMessageIndex, mcap::kMetadata}) {
    Bytes bytes = left;
    bytes.push_back(opcode);
    bytes.resize(left.size() + 500, 0xA7);
    writeFile(bytes);
    auto reader = McapReader::open(file_);
    ASSERT_TRUE(reader);
    EXPECT_EQ(readAll(*reader).size(), 20U);
    EXPECT_TRUE(reader->isDamaged()) << int{opcode};
  }
}

// by the times in their heads, which no checksum covers, chunks are passed over
TEST_F(McapTest, ASeekFindsTheMessagesOfAChunkThatSaysOtherTimes) {
  const auto written = record(40);
  const Bytes whole = fileBytes();
  const Record chunk = chunksOf(whole)[2];
  for (const std::int64_t wrong : {std::int64_t{0}, std::int64_t{7}, std::int64_t{1} << 40}) {
    for (const bool is_cut : {false, true}) {
      SCOPED_TRACE(std::to_string(wrong) + (is_cut ? ", cut" : ""));
      Bytes bytes = is_cut ? unfinished(whole) : whole;
      std::memcpy(bytes.data() + chunk.begin + mcap::kRecordHeaderBytes + sizeof wrong, &wrong, sizeof wrong);
      if (is_cut) bytes.resize(chunksOf(bytes)[3].begin);
      writeFile(bytes);
      auto reader = McapReader::open(file_);
      ASSERT_TRUE(reader);
      EXPECT_EQ(reader->lastTime(), written[is_cut ? 29 : 39].time);
      EXPECT_THAT(reader->problem(), HasSubstr("a chunk (bytes " + std::to_string(chunk.begin)));
      EXPECT_THAT(reader->problem(), HasSubstr("other times than those of its messages"));
      reader->seek(written[25].time);
      McapMessage message;
      ASSERT_TRUE(reader->next(message));
      EXPECT_EQ(message.sequence, 25U);
    }
    // nor do they come into the summary of a file that is continued
    Bytes left = unfinished(whole);
    std::memcpy(left.data() + chunk.begin + mcap::kRecordHeaderBytes + sizeof wrong, &wrong, sizeof wrong);
    writeFile(left);
    ASSERT_TRUE(McapWriter::reopen(file_)->close());
    const Bytes continued = fileBytes();
    std::vector<std::int64_t> ends;
    for (const Record& record : recordsOf(continued)) {
      if (record.opcode != mcap::kChunkIndex) continue;
      ends.emplace_back();
      std::memcpy(&ends.back(), continued.data() + record.begin + mcap::kRecordHeaderBytes + sizeof wrong,
                  sizeof wrong);
    }
    ASSERT_EQ(ends.size(), 4U);
    EXPECT_EQ(ends[2], written[29].time);
  }
}

TEST_F(McapTest, DamagedMetadataAreReported) {
  record(20);
  const Bytes whole = fileBytes();
  Record metadata;
  for (const Record& record : recordsOf(whole))
    if (record.opcode == mcap::kMetadata) metadata = record;
  const auto name = std::search(whole.begin() + static_cast<std::ptrdiff_t>(metadata.begin), whole.end(),
                                std::begin("Ada"), std::end("Ada") - 1);
  Bytes bytes = whole;
  bytes[static_cast<std::size_t>(name - whole.begin())] ^= 2U;
  writeFile(bytes);
  auto reader = McapReader::open(file_);
  ASSERT_TRUE(reader);
  EXPECT_TRUE(reader->isDamaged());
  EXPECT_THAT(reader->problem(), HasSubstr("metadata (bytes " + std::to_string(metadata.begin)));
  EXPECT_THAT(reader->metadata().find("about")->second,
              testing::ElementsAre(testing::Pair("who", "Cda"), testing::Pair("why", "")));
}

// a chunk of zeros, a few hundred bytes that claim the most a chunk may hold
TEST_F(McapTest, AChunkThatClaimsMoreThanItsBytesCanHoldIsNotUnpacked) {
  record(20);
  const Bytes left = unfinished(fileBytes());
  const auto bomb = [](std::size_t size) {
    const auto packed = compress(Bytes(size)).value();
    mcap::FieldWriter fields;
    fields.put(std::int64_t{0});
    fields.put(std::int64_t{0});
    fields.put(std::uint64_t{size});
    fields.put(std::uint32_t{1});
    fields.put(std::string_view("zstd"));
    fields.put(static_cast<std::uint64_t>(packed.size()));
    fields.putBytes(packed);
    mcap::FieldWriter record;
    record.put(mcap::kChunk);
    record.put(static_cast<std::uint64_t>(fields.bytes.size()));
    record.putBytes(fields.bytes);
    return record.bytes;
  };
  Bytes bytes = left;
  for (const std::size_t size : {1U << 20U, 16U << 20U}) {
    const auto one = bomb(size);
    ASSERT_LT(256 * one.size(), size);
    bytes.insert(bytes.end(), one.begin(), one.end());
  }
  writeFile(bytes);
  auto reader = McapReader::open(file_);
  ASSERT_TRUE(reader);
  EXPECT_EQ(readAll(*reader).size(), 20U);
  EXPECT_THAT(reader->problem(), HasSubstr("claims to hold more than it can and is skipped"));
  EXPECT_TRUE(McapWriter::reopen(file_)) << "they are no last chunk";
}

// each head claims the megabyte after all of them: were each of these checked, the time would be their
// product
TEST_F(McapTest, TheSearchAfterDamageEndsAndIsSaidToHave) {
  record(40);
  const Bytes left = unfinished(fileBytes());
  constexpr std::size_t kClaimed = 1U << 20U;
  mcap::FieldWriter fields;
  fields.put(std::int64_t{0});
  fields.put(std::int64_t{0});
  fields.put(std::uint64_t{kClaimed});
  fields.put(std::uint32_t{1});
  fields.put(std::string_view());
  fields.put(std::uint64_t{kClaimed});
  mcap::FieldWriter head;
  head.put(mcap::kChunk);
  head.put(static_cast<std::uint64_t>(fields.bytes.size() + kClaimed));
  head.putBytes(fields.bytes);
  const auto chunks = chunksOf(left);
  Bytes bytes(left.begin(), left.begin() + static_cast<std::ptrdiff_t>(chunks[2].begin));
  bytes.push_back(0);
  for (int i = 0; i < 100; ++i) bytes.insert(bytes.end(), head.bytes.begin(), head.bytes.end());
  bytes.resize(bytes.size() + kClaimed);
  bytes.insert(bytes.end(), left.begin() + static_cast<std::ptrdiff_t>(chunks[2].begin), left.end());
  writeFile(bytes);
  auto reader = McapReader::open(file_);
  ASSERT_TRUE(reader);
  EXPECT_EQ(readAll(*reader).size(), 20U);
  EXPECT_TRUE(reader->isDamaged());
  EXPECT_THAT(reader->problem(),
              HasSubstr("is damaged from byte " + std::to_string(chunks[2].begin) + " on"));
  const auto continued = McapWriter::reopen(file_);
  ASSERT_FALSE(continued) << "what follows would be cut off";
  EXPECT_EQ(fileBytes(), bytes);
}

TEST_F(McapTest, RandomBytesAfterTheMagicNeverCrash) {
  std::mt19937_64 random(13);
  for (int round = 0; round < 500; ++round) {
    Bytes bytes(mcap::kMagic, mcap::kMagic + sizeof(mcap::kMagic));
    for (int record = 0; record < 5; ++record) {
      const std::uint64_t length = random() % 60;
      bytes.push_back(static_cast<std::uint8_t>(1 + random() % 16));
      for (int i = 0; i < 8; ++i) bytes.push_back(static_cast<std::uint8_t>(length >> (8 * i)));
      for (std::uint64_t i = 0; i < length; ++i)
        bytes.push_back(static_cast<std::uint8_t>(random() % 3 == 0 ? random() : 0));
    }
    writeFile(bytes);
    auto reader = McapReader::open(file_);
    ASSERT_TRUE(reader);
    readAll(*reader);
  }
}

/// Sets the checksums of chunks, attachments and the summary to those of the bytes, as far as the records can
/// be followed. Only chunks that are not compressed have one that damage can be hidden behind.
void correctChecksums(Bytes& bytes) {
  const auto number = [&bytes](std::size_t at, std::size_t size) {
    std::uint64_t value = 0;
    std::memcpy(&value, bytes.data() + at, size);
    return value;
  };
  const auto setCrc = [&bytes](std::size_t at, std::size_t first, std::size_t last) {
    const std::uint32_t crc = mcap::crc32(std::span(bytes).subspan(first, last - first));
    std::memcpy(bytes.data() + at, &crc, sizeof crc);
  };
  std::size_t summary = 0;
  for (std::size_t at = sizeof(mcap::kMagic); at + mcap::kRecordHeaderBytes <= bytes.size();) {
    const std::uint64_t length = number(at + 1, 8);
    const std::size_t fields = at + mcap::kRecordHeaderBytes;
    if (bytes.size() - fields < length) return;
    const std::size_t end = fields + length;
    if (bytes[at] == mcap::kChunk && length >= 40) {
      // two times, the size and the checksum come before the name of the compression
      const std::size_t records = fields + 32 + number(fields + 28, 4) + 8;
      const std::uint64_t size = records <= end ? number(records - 8, 8) : 0;
      if (records <= end && size <= end - records) setCrc(fields + 24, records, records + size);
    }
    if (bytes[at] == mcap::kAttachment && length >= 4) setCrc(end - 4, fields, end - 4);
    if (bytes[at] == mcap::kDataEnd) summary = end;
    if (bytes[at] == mcap::kFooter && length >= 4 && summary != 0) return setCrc(end - 4, summary, end - 4);
    at = end;
  }
}

/// Reads `rounds` damaged recordings whose checksums are right.
void readDamaged(const std::filesystem::path& file, const Bytes& whole, std::uint64_t rounds) {
  std::uint64_t whole_files = 0;
  std::uint64_t problems = 0;
  for (std::uint64_t round = 0; round < rounds; ++round) {
    SCOPED_TRACE("damage " + std::to_string(round));
    Bytes bytes = whole;
    test::FileDamage damage(round);
    if (round % 16 == 0) damage.truncate(bytes);
    damage.damage(bytes, sizeof(mcap::kMagic));
    correctChecksums(bytes);
    test::writeBytes(file, bytes);
    auto reader = McapReader::open(file);
    if (!reader) {
      ASSERT_THAT(reader.error().what, HasSubstr(file.string()));
      continue;
    }
    std::size_t read = 0;
    for (const std::int64_t from : {std::int64_t{0}, std::int64_t{1300}}) {
      reader->seek(from);
      for (McapMessage message; reader->next(message);) {
        ASSERT_GE(message.log_time_ns, from);
        read += message.topic.size() + message.type_name.size();
        for (const std::uint8_t byte : message.data) read += byte;
      }
    }
    for (const McapChannel& channel : reader->channels())
      read += channel.topic.size() + channel.schema_text.size();
    for (const McapAttachment& attachment : reader->attachments())
      for (const std::uint8_t byte : attachment.data) read += byte;
    ASSERT_THAT(reader->problem(), testing::AnyOf("", HasSubstr(file.string())));
    // behind a length that is damaged the checksums are not corrected
    ASSERT_THAT(reader->problem(),
                testing::AnyOf(testing::Not(HasSubstr("wrong checksum")), HasSubstr("is damaged between")));
    if (!reader->problem().empty()) ++problems;
    if (reader->complete() && reader->problem().empty() && read > 0) ++whole_files;
  }
  EXPECT_GT(problems, rounds / 50);
  EXPECT_GT(whole_files, rounds / 10) << "damage of what a message holds is not detectable";
}

TEST_F(McapTest, DamageBehindRightChecksumsIsReportedOrHarmless) {
  record(40, false);
  readDamaged(file_, fileBytes(), 4000);
}

class McapNightly : public McapTest {};

TEST_F(McapNightly, DamageBehindRightChecksumsIsReportedOrHarmless) {
  record(40, false);
  readDamaged(file_, fileBytes(), 100'000);
}

TEST_F(McapTest, TheChecksumsOfAnUndamagedFileAreLeftAsTheyAre) {
  record(40, false);
  const Bytes whole = fileBytes();
  Bytes bytes = whole;
  correctChecksums(bytes);
  EXPECT_EQ(bytes, whole) << "else the damaged files are refused for their checksums";
  bytes[whole.size() / 3] ^= 1U;
  const Bytes damaged = bytes;
  correctChecksums(bytes);
  EXPECT_NE(bytes, damaged);
}

}  // namespace
}  // namespace tenon::record
