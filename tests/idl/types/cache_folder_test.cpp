#include "idl/types/cache_folder.h"

#include <cstdlib>
#include <string>

#include <gtest/gtest.h>

namespace tenon {
namespace {

TEST(DefaultCache, IsTakenFromTheEnvironment) {
  const char* const before = std::getenv("TENON_CACHE");
  const std::string kept = before != nullptr ? before : "";
  setenv("TENON_CACHE", "/somewhere/else", 1);
  EXPECT_EQ(defaultCache(), "/somewhere/else");
  unsetenv("TENON_CACHE");
  EXPECT_NE(defaultCache(), "/somewhere/else");
  setenv("TENON_CACHE", "", 1);
  EXPECT_TRUE(defaultCache().is_absolute()) << "an empty variable names no folder";
  if (before != nullptr) setenv("TENON_CACHE", kept.c_str(), 1);
  if (before == nullptr) unsetenv("TENON_CACHE");
}

}  // namespace
}  // namespace tenon
