#include "idl/record/recording_kind.h"

#include <atomic>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "tests/idl/record/mcap_fixture.h"

namespace tenon::record {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

constexpr std::size_t kFooterFields = 8 + 8 + 4;  // [bytes]

/// Recordings of two topics of a session in three chunks.
class RecordingKindTest : public McapTest {
 protected:
  RecordingKindTest() {
    auto writer = McapWriter::open(file_, {.compress = false});
    const std::uint16_t channels[] = {writer->addChannel("A", "tenon::A", "module tenon { struct A {}; };"),
                                      writer->addChannel("B", "tenon::B", "module tenon { struct B {}; };")};
    for (std::uint32_t i = 0; i < 30; ++i) {
      EXPECT_TRUE(writer->write(channels[i % 2], 1000 + i, i, Bytes{'m', 'a', 'r', 'k'}));
      if (i % 10 == 9) {
        EXPECT_TRUE(writer->flush());
      }
    }
    EXPECT_TRUE(writer->addMetadata("about", {{"who", "Ada"}}));
    EXPECT_TRUE(writer->addAttachment("note.txt", "text/plain", Bytes{'h', 'i'}));
    EXPECT_TRUE(writer->close());
    whole_ = fileBytes();
  }
  /// What is said of the file after a change of its bytes.
  std::string refusalAfter(const std::function<void(Bytes&)>& change) {
    Bytes bytes = whole_;
    change(bytes);
    writeFile(bytes);
    const auto playable = checkPlayable(file_, stop_);
    return playable ? "" : playable.error().what;
  }
  std::vector<Record> recordsOfKind(std::uint8_t opcode) const {
    auto records = recordsOf(whole_);
    std::erase_if(records, [opcode](const Record& record) { return record.opcode != opcode; });
    return records;
  }
  template <class T>
  static void put(Bytes& bytes, std::size_t at, T value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
  }
  /// As if a program had written what is wrong.
  void putSummaryChecksum(Bytes& bytes) const {
    const std::size_t begin = recordsOfKind(mcap::kDataEnd)[0].end;
    const std::size_t end = bytes.size() - sizeof(mcap::kMagic) - 4;
    put(bytes, end, mcap::crc32(std::span(bytes).subspan(begin, end - begin)));
  }

  Bytes whole_;
  const std::atomic<bool> stop_{false};
};

TEST_F(RecordingKindTest, AWholeRecordingCanBePlayed) {
  const auto playable = checkPlayable(file_, stop_);
  ASSERT_TRUE(playable) << playable.error().what;
  EXPECT_THAT(*playable, IsEmpty());
}

TEST_F(RecordingKindTest, HowFarItIsIsToldAfterEachChunk) {
  std::vector<double> fractions;
  ASSERT_TRUE(checkPlayable(file_, stop_, [&](double fraction) { fractions.push_back(fraction); }));
  ASSERT_EQ(fractions.size(), 3U);
  EXPECT_GT(fractions[0], 0.0);
  EXPECT_LT(fractions[0], fractions[1]);
  EXPECT_LT(fractions[1], fractions[2]);
  EXPECT_LE(fractions[2], 1.0);
}

TEST_F(RecordingKindTest, DamagedChunksAreCountedAndTheFirstIsNamed) {
  const auto chunks = chunksOf(whole_);
  ASSERT_EQ(chunks.size(), 3U);
  const std::string refusal = refusalAfter([&](Bytes& bytes) {
    ++bytes[chunks[1].end - 1];
    ++bytes[chunks[2].end - 1];
  });
  EXPECT_EQ(refusal, file_.string() +
                         ": 2 of its 3 chunks are damaged or not where its index says, the first in bytes " +
                         std::to_string(chunks[1].begin) + " to " + std::to_string(chunks[1].end) +
                         ", so it cannot be played; `tenon report " + file_.string() +
                         "` reads what is whole");
}

TEST_F(RecordingKindTest, AWrongSummaryIsNamed) {
  const std::size_t footer = whole_.size() - sizeof(mcap::kMagic) - kFooterFields;
  const auto movesSummary = [&](Bytes& bytes) {
    put<std::uint64_t>(bytes, footer, chunksOf(whole_)[1].begin);
  };
  const auto hasNone = [&](Bytes& bytes) { put<std::uint64_t>(bytes, footer, 0); };
  for (const auto& change : std::vector<std::function<void(Bytes&)>>{movesSummary, hasNone}) {
    EXPECT_THAT(refusalAfter(change),
                HasSubstr("the summary at its end, which says where everything is, is damaged"));
    EXPECT_THAT(refusalAfter([&](Bytes& bytes) { change(bytes), putSummaryChecksum(bytes); }),
                HasSubstr("so it cannot be played; `tenon report"));
  }
}

TEST_F(RecordingKindTest, AnIndexThatIsWrongBehindARightChecksumIsNamed) {
  const Record chunk_index = recordsOfKind(mcap::kChunkIndex)[1];
  const std::size_t fields = chunk_index.begin + mcap::kRecordHeaderBytes;
  // times, place and length of the chunk, and the place of its first message index
  for (const std::size_t at : {0U, 8U, 16U, 24U, 38U}) {
    EXPECT_THAT(refusalAfter([&](Bytes& bytes) {
                  ++bytes[fields + at];
                  putSummaryChecksum(bytes);
                }),
                StartsWith(file_.string() + ": 1 of its 3 chunks are damaged or not where its index says"))
        << at;
  }
  const Record metadata_index = recordsOfKind(mcap::kMetadataIndex)[0];
  EXPECT_THAT(refusalAfter([&](Bytes& bytes) {
                ++bytes[metadata_index.begin + mcap::kRecordHeaderBytes];
                putSummaryChecksum(bytes);
              }),
              HasSubstr("its metadata are not where its index says"));
}

TEST_F(RecordingKindTest, AMessageIndexThatIsWrongIsNamed) {
  const Record index = recordsOfKind(mcap::kMessageIndex)[0];
  // the channel, the time and the place of the first message
  for (const std::size_t at : {0U, 6U, 14U})
    EXPECT_THAT(refusalAfter([&](Bytes& bytes) { ++bytes[index.begin + mcap::kRecordHeaderBytes + at]; }),
                HasSubstr("1 of its 3 chunks"))
        << at;
}

TEST_F(RecordingKindTest, DamageThatAPlayerDoesNotReadIsARemark) {
  const Record attachment = recordsOfKind(mcap::kAttachment)[0];
  Bytes bytes = whole_;
  ++bytes[attachment.end - 5];
  writeFile(bytes);
  const auto playable = checkPlayable(file_, stop_);
  ASSERT_TRUE(playable) << playable.error().what;
  EXPECT_THAT(*playable, HasSubstr("an attachment"));
}

TEST_F(RecordingKindTest, ChunksThatAreNotInTheIndexAreARemark) {
  const Record chunk_index = recordsOfKind(mcap::kChunkIndex)[1];
  Bytes bytes = whole_;
  bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(chunk_index.begin),
              bytes.begin() + static_cast<std::ptrdiff_t>(chunk_index.end));
  putSummaryChecksum(bytes);
  writeFile(bytes);
  const auto playable = checkPlayable(file_, stop_);
  ASSERT_TRUE(playable) << playable.error().what;
  EXPECT_THAT(*playable, HasSubstr("1 of its chunks are not in its index and are not played"));
}

}  // namespace
}  // namespace tenon::record
