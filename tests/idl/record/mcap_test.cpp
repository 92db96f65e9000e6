#include <csignal>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "idl/record/instance_state.h"
#include "tests/idl/record/mcap_fixture.h"

namespace tenon::record {
namespace {

using testing::HasSubstr;

TEST_F(McapTest, MessagesAreReadBackInFileOrder) {
  for (const bool compress : {true, false}) {
    const auto written = record(95, compress);
    auto reader = McapReader::open(file_);
    ASSERT_TRUE(reader) << reader.error().what;
    EXPECT_TRUE(reader->complete());
    EXPECT_EQ(reader->problem(), "");
    EXPECT_EQ(readAll(*reader), written);
  }
}

TEST_F(McapTest, ChannelsMetadataAndAttachmentsAreKnownAfterOpening) {
  record(30);
  auto reader = McapReader::open(file_);
  ASSERT_EQ(reader->channels().size(), 2U);
  EXPECT_EQ(reader->channels()[0].topic, "A");
  EXPECT_EQ(reader->channels()[0].type_name, "t::A");
  EXPECT_THAT(reader->channels()[0].schema_text, HasSubstr("struct A"));
  EXPECT_EQ(reader->channels()[0].messages, 20U);
  EXPECT_EQ(reader->channels()[1].messages, 10U);
  ASSERT_EQ(reader->metadata().size(), 1U);
  EXPECT_EQ(reader->metadata().find("about")->second.at("who"), "Ada");
  ASSERT_EQ(reader->attachments().size(), 1U);
  EXPECT_EQ(reader->attachments()[0].media_type, "text/plain");
  EXPECT_EQ(std::string(reader->attachments()[0].data.begin(), reader->attachments()[0].data.end()), "hi");
}

TEST_F(McapTest, SeekFindsTheFirstMessageAtOrAfterATimeInBothDirections) {
  const auto written = record(100);
  auto reader = McapReader::open(file_);
  for (const int index : {70, 3, 99, 0}) {
    reader->seek(written[static_cast<std::size_t>(index)].time - 5);
    McapMessage message;
    ASSERT_TRUE(reader->next(message));
    EXPECT_EQ(message.sequence, static_cast<std::uint32_t>(index));
  }
  reader->seek(1'000'000);
  McapMessage message;
  EXPECT_FALSE(reader->next(message));
}

TEST_F(McapTest, AFileWithoutMessagesIsComplete) {
  ASSERT_TRUE(McapWriter::open(file_)->close());
  auto reader = McapReader::open(file_);
  ASSERT_TRUE(reader);
  EXPECT_TRUE(reader->complete());
  EXPECT_TRUE(readAll(*reader).empty());
}

TEST_F(McapTest, AClosedWriterRefusesMessages) {
  auto writer = McapWriter::open(file_);
  const auto channel = writer->addChannel("A", "t::A", "");
  ASSERT_TRUE(writer->close());
  EXPECT_FALSE(writer->write(channel, 0, 0, {}));
  EXPECT_FALSE(writer->flush());
  EXPECT_TRUE(writer->close());
}

TEST_F(McapTest, AFullDiskIsAnErrorThatNamesTheFile) {
  auto writer = McapWriter::open("/dev/full");
  ASSERT_FALSE(writer);
  EXPECT_THAT(writer.error().what, HasSubstr("/dev/full: cannot write"));
}

TEST_F(McapTest, WhatShrinksToNothingIsReadBack) {
  const Bytes zeros(8192);
  {
    auto writer = McapWriter::open(file_);
    const auto channel = writer->addChannel("A", "t::A", "");
    for (std::uint32_t i = 0; i < 200; ++i) ASSERT_TRUE(writer->write(channel, 0, 0, zeros));
    ASSERT_TRUE(writer->close());
  }
  auto reader = McapReader::open(file_);
  ASSERT_TRUE(reader);
  EXPECT_EQ(readAll(*reader).size(), 200U);
  EXPECT_FALSE(reader->isDamaged()) << reader->problem();
}

TEST_F(McapTest, APipeIsAnErrorAndNotWaitedFor) {
  ASSERT_EQ(mkfifo(file_.c_str(), 0600), 0);
  const auto writer = McapWriter::open(file_);
  ASSERT_FALSE(writer);
  EXPECT_THAT(writer.error().what, HasSubstr("is a pipe"));
}

// a limit of the file's size stands for a disk that becomes full, and has room again later
TEST_F(McapTest, AfterAWriteThatFailedTheFileEndsBeforeItAndStaysSo) {
  struct rlimit before {};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  {
    auto writer = McapWriter::open(file_, {.compress = false});
    const auto channel = writer->addChannel("A", "t::A", "");
    ASSERT_TRUE(writer->write(channel, 1, 0, Bytes(100)));
    ASSERT_TRUE(writer->flush());
    const std::size_t good = fileBytes().size();
    const rlimit full{.rlim_cur = good + 50, .rlim_max = before.rlim_max};
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &full), 0);
    ASSERT_TRUE(writer->write(channel, 2, 1, Bytes(100)));
    const auto failed = writer->flush();
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
    ASSERT_FALSE(failed);
    EXPECT_THAT(failed.error().what, HasSubstr(file_.string() + ": cannot write"));
    EXPECT_EQ(fileBytes().size(), good) << "no part of the record that did not fit";
    EXPECT_FALSE(writer->write(channel, 3, 2, Bytes(100)));
    EXPECT_FALSE(writer->addMetadata("about", {}));
    EXPECT_FALSE(writer->close());
    EXPECT_EQ(fileBytes().size(), good);
  }
  std::signal(SIGXFSZ, handler);
  auto reader = McapReader::open(file_);
  ASSERT_TRUE(reader);
  EXPECT_FALSE(reader->complete());
  EXPECT_EQ(readAll(*reader).size(), 1U);
}

TEST_F(McapTest, AFileThatIsNoRecordingIsAnErrorThatNamesIt) {
  EXPECT_THAT(McapReader::open("no/such.mcap").error().what, HasSubstr("no/such.mcap: cannot be opened"));
  EXPECT_THAT(McapReader::open("/tmp").error().what, HasSubstr("is empty or not a file"));
  writeFile(Bytes(100, 'x'));
  EXPECT_THAT(McapReader::open(file_).error().what, HasSubstr("is not a recording"));
}

TEST(InstanceState, IsReadBackFromItsBytes) {
  for (const char* topic : {"A", "Ab", "Abc", "ObjectSnapshot"}) {
    const InstanceGone gone{topic, {0, 1, 0, 0, 7, 0, 0, 0}};
    const auto bytes = encodeInstanceGone(gone);
    const auto decoded = decodeInstanceGone(bytes);
    ASSERT_TRUE(decoded) << topic;
    EXPECT_EQ(decoded->topic, topic);
    EXPECT_EQ(decoded->key_sample, gone.key_sample);
    for (std::size_t size = 0; size < bytes.size(); ++size)
      EXPECT_FALSE(decodeInstanceGone(std::span(bytes).first(size)));
  }
}

}  // namespace
}  // namespace tenon::record
