#include "server/session/renamed_options.h"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

namespace tenon::session {
namespace {

using ::testing::HasSubstr;

TEST(RenamedOptions, AFormerOptionIsAnsweredWithThePresentName) {
  const std::array arguments{"tenon-serve", "--workers", "2", "--rerun", "journal.mcap"};
  EXPECT_EQ(renamedOption(arguments), "option --rerun is now named --resimulate");
  const std::array joined{"tenon-serve", "--rerun=journal.mcap"};
  EXPECT_EQ(renamedOption(joined), "option --rerun is now named --resimulate");
  const std::array flag{"tenon-serve", "--resimulate", "journal.mcap", "--anyway"};
  EXPECT_EQ(renamedOption(flag), "option --anyway is now named --despite-changes");
}

TEST(RenamedOptions, PresentOptionsAndOtherWordsHaveNoAnswer) {
  const std::array arguments{"tenon-serve",       "--resimulate", "rerun.mcap",
                             "--despite-changes", "anyway",       "--rerun-x"};
  EXPECT_FALSE(renamedOption(arguments));
}

TEST(RenamedOptions, TenonServeEndsWithExitCodeTwoAndOneLine) {
  const char* const programs = std::getenv("TENON_PROGRAMS");
  if (programs == nullptr) GTEST_SKIP() << "TENON_PROGRAMS does not name the folder of the programs";
  const auto program = std::filesystem::path(programs) / "tenon-serve";
  ASSERT_TRUE(std::filesystem::exists(program)) << program;
  for (const std::string option : {"--rerun journal.mcap", "--anyway"}) {
    std::FILE* const pipe = popen((program.string() + " " + option + " 2>&1").c_str(), "r");
    ASSERT_NE(pipe, nullptr);
    std::string output;
    for (int letter = std::fgetc(pipe); letter != EOF; letter = std::fgetc(pipe))
      output += static_cast<char>(letter);
    const int status = pclose(pipe);
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 2) << option;
    EXPECT_THAT(output, HasSubstr("is now named --"));
    EXPECT_EQ(output.find('\n'), output.size() - 1) << "one line";
  }
}

}  // namespace
}  // namespace tenon::session
