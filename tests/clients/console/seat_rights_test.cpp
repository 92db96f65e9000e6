#include "clients/console/seat_rights.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tenon::console {
namespace {

DeskRequest requestFor(const std::string& role, const std::string& key = {}) {
  return {.kind = DeskRequest::Kind::kSit, .id = 1, .role = role, .name = "Ada", .key = key};
}

// the gateway would prove the key of its own user for a stranger
TEST(SeatRights, ATraineeWhomTheNetworkBringsNeedsKeyOrPass) {
  SeatRights rights{.role = Role::kInstructor, .pass = "secret"};
  EXPECT_TRUE(membershipOf(rights, "lab", requestFor("trainee")));
  rights.is_local = false;
  const auto refused = membershipOf(rights, "lab", requestFor("trainee"));
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().what, ::testing::HasSubstr("trainee needs the key of the session"));
  EXPECT_TRUE(membershipOf(rights, "lab", requestFor("trainee", "secret")));
  const auto with_key = membershipOf(rights, "lab", requestFor("trainee", std::string(64, 'a')));
  ASSERT_TRUE(with_key) << with_key.error().what;
  EXPECT_TRUE(with_key->key.has_value());
}

}  // namespace
}  // namespace tenon::console
