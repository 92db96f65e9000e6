#pragma once

#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "idl/record/mcap_format.h"
#include "idl/record/mcap_reader.h"
#include "idl/record/mcap_writer.h"

namespace tenon::record {

using Bytes = std::vector<std::uint8_t>;

struct StoredMessage {
  std::string topic;
  std::int64_t time = 0;
  std::uint32_t sequence = 0;
  Bytes data;
  bool operator==(const StoredMessage&) const = default;
};

class McapTest : public ::testing::Test {
 protected:
  ~McapTest() override { std::filesystem::remove(file_); }

  /// Writes messages on two topics in chunks of ten and returns them.
  std::vector<StoredMessage> record(int count, bool compress = true) {
    std::mt19937_64 random(7);
    std::vector<StoredMessage> all;
    auto writer = McapWriter::open(file_, {.compress = compress});
    const std::uint16_t channels[] = {writer->addChannel("A", "t::A", "module t { struct A {}; };"),
                                      writer->addChannel("B", "t::B", "module t { struct B {}; };")};
    for (int i = 0; i < count; ++i) {
      StoredMessage message{i % 3 == 0 ? "B" : "A", 1000 + 10 * i, static_cast<std::uint32_t>(i),
                            Bytes(random() % 40)};
      for (std::uint8_t& byte : message.data) byte = static_cast<std::uint8_t>(random() % 4);
      EXPECT_TRUE(writer->write(channels[i % 3 == 0 ? 1 : 0], message.time, message.sequence, message.data));
      all.push_back(std::move(message));
      if (i % 10 == 9) {
        EXPECT_TRUE(writer->flush());
      }
    }
    EXPECT_TRUE(writer->addMetadata("about", {{"who", "Ada"}, {"why", ""}}));
    EXPECT_TRUE(writer->addAttachment("note.txt", "text/plain", Bytes{'h', 'i'}));
    EXPECT_TRUE(writer->close());
    return all;
  }
  static std::vector<StoredMessage> readAll(McapReader& reader) {
    std::vector<StoredMessage> all;
    for (McapMessage message; reader.next(message);)
      all.push_back({std::string(message.topic),
                     message.log_time_ns,
                     message.sequence,
                     {message.data.begin(), message.data.end()}});
    return all;
  }
  Bytes fileBytes() const {
    std::ifstream in(file_, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  struct Record {
    std::uint8_t opcode = 0;
    std::size_t begin = 0, end = 0;  // [bytes]
  };
  static std::vector<Record> recordsOf(const Bytes& bytes) {
    std::vector<Record> records;
    for (std::size_t at = sizeof(mcap::kMagic); at + mcap::kRecordHeaderBytes <= bytes.size();) {
      std::uint64_t length = 0;
      std::memcpy(&length, bytes.data() + at + 1, sizeof length);
      records.push_back({bytes[at], at, at + mcap::kRecordHeaderBytes + length});
      at = records.back().end;
    }
    return records;
  }
  static std::vector<Record> chunksOf(const Bytes& bytes) {
    auto records = recordsOf(bytes);
    std::erase_if(records, [](const Record& record) { return record.opcode != mcap::kChunk; });
    return records;
  }
  /// Without the end of the data and what follows, as a killed program leaves it.
  static Bytes unfinished(Bytes bytes) {
    for (const Record& record : recordsOf(bytes))
      if (record.opcode == mcap::kDataEnd) bytes.resize(record.begin);
    return bytes;
  }
  void writeFile(std::span<const std::uint8_t> bytes) const {
    std::ofstream out(file_, std::ios::binary);
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }

  std::filesystem::path file_ =
      std::filesystem::temp_directory_path() / ("mcap_" + std::to_string(getpid()) + ".mcap");
};

}  // namespace tenon::record
