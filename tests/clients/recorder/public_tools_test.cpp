#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>
#include <unistd.h>

#include "idl/record/instance_state.h"
#include "idl/record/mcap_writer.h"
#include "idl/wire/codec.h"
#include "tests/idl/wire/random_messages.h"
#include "tests/support/source_folder.h"

namespace tenon::recorder {
namespace {

/// Writes random messages of every topic, and a few ended instances.
void recordEverything(const std::filesystem::path& file) {
  test::RandomMessages random(3), full(4, true);
  auto writer = record::McapWriter::open(file);
  std::int64_t time = 1000;
  wire::forEachTopic([&]<class M>(const wire::Topic<M>& topic) {
    const auto channel = writer->addChannel(topic.name, wire::typeName<M>(), wire::idlText());
    for (std::uint32_t i = 0; i < 40; ++i) {
      const auto bytes = wire::encode(i % 2 == 0 ? full.make<M>() : random.make<M>());
      ASSERT_TRUE(writer->write(channel, time++, i, *bytes));
    }
  });
  const auto ended =
      writer->addChannel(record::kInstanceStateTopic, record::kInstanceStateType, record::kInstanceStateIdl);
  for (std::uint32_t i = 0; i < 9; ++i) {
    const auto bytes = record::encodeInstanceGone({std::string(i + 1, 'x'), std::vector<std::uint8_t>(i)});
    ASSERT_TRUE(writer->write(ended, time++, i, bytes));
  }
  ASSERT_TRUE(writer->close());
}

TEST(PublicTools, DecodeEveryMessageOfEveryTopic) {
  const std::filesystem::path tools = test::sourceFolder() / "tests/system/public_tools";
  if (!std::filesystem::exists(tools / "node_modules"))
    GTEST_SKIP() << "the public tools are not installed: npm ci in tests/system/public_tools";
  const auto file =
      std::filesystem::temp_directory_path() / ("everything_" + std::to_string(getpid()) + ".mcap");
  recordEverything(file);
  const std::string command =
      "node '" + (tools / "read_recording.mjs").string() + "' '" + file.string() + "' >/dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0);
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace tenon::recorder
