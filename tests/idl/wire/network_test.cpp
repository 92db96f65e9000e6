#include "idl/wire/network.h"

#include <cstdlib>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "idl/wire/participant.h"

namespace tenon::wire {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// An environment variable for one test.
class ScopedVariable {
 public:
  ScopedVariable(const char* name, const char* value) : name_(name) { setenv(name, value, 1); }
  ~ScopedVariable() { unsetenv(name_); }
  ScopedVariable(const ScopedVariable&) = delete;
  ScopedVariable& operator=(const ScopedVariable&) = delete;

 private:
  const char* name_;
};

TEST(FindNetwork, LoopbackIsThisMachine) {
  const auto network = findNetwork("loopback");
  ASSERT_TRUE(network) << network.error().what;
  EXPECT_EQ(network->reach, Reach::kLoopback);
  EXPECT_EQ(audienceOf(*network), "");
  EXPECT_THAT(networkConfig(*network), HasSubstr("127.0.0.1"));
}

TEST(FindNetwork, RefusesWhatIsNoNetworkAndSaysWhatIs) {
  const auto mistyped = findNetwork("lann");
  ASSERT_FALSE(mistyped);
  EXPECT_THAT(mistyped.error().what, HasSubstr("network 'lann': 'lann' is neither loopback, lan nor wan"));
  const auto peers = findNetwork("loopback,10.0.0.1");
  ASSERT_FALSE(peers);
  EXPECT_THAT(peers.error().what, HasSubstr("name lan, wan or an interface"));
  const auto unknown = findNetwork("lan,no-such-host.invalid");
  ASSERT_FALSE(unknown);
  EXPECT_THAT(unknown.error().what, HasSubstr("'no-such-host.invalid' has no IPv4 address"));
  EXPECT_FALSE(findNetwork(""));
}

TEST(NetworkConfig, NamesInterfaceAndPeers) {
  const Network lan{Reach::kLan, "lan", "eth0", "10.0.0.5/24", {"10.0.0.7"}};
  EXPECT_THAT(networkConfig(lan), HasSubstr("<NetworkInterface address=\"10.0.0.5\"/>"));
  EXPECT_THAT(networkConfig(lan), HasSubstr("<Peer Address=\"10.0.0.7\"/>"));
  EXPECT_THAT(networkConfig(lan), Not(HasSubstr("<Peer Address=\"10.0.0.5\"/>"))) << "multicast finds them";
  EXPECT_THAT(audienceOf(lan), HasSubstr("every program in 10.0.0.5/24 and at the peers"));
  const Network wan{Reach::kWan, "wan", "wg0", "10.77.0.1/24", {}};
  EXPECT_THAT(networkConfig(wan), HasSubstr("<Peer Address=\"10.77.0.1\"/>")) << "programs of this machine";
  EXPECT_THAT(networkConfig(wan), HasSubstr("<AllowMulticast>false</AllowMulticast>"));
}

// adapted, it is a few kB after some killed readers, and reliable writes to all others fail
TEST(NetworkConfig, HasAFixedLimitOfWhatReadersHaveYetToAcknowledge) {
  for (const Reach reach : {Reach::kLoopback, Reach::kLan, Reach::kWan}) {
    const Network network{reach, "test", "lo", "127.0.0.1/8", {}};
    EXPECT_THAT(networkConfig(network), HasSubstr("<WhcAdaptive>false</WhcAdaptive>"));
  }
}

TEST(NetworkConfig, IsOneThatDdsTakes) {
  std::uint32_t domain = 210;
  for (const Reach reach : {Reach::kLan, Reach::kWan}) {
    const Network network{reach, "test", "lo", "127.0.0.1/8", {"127.0.0.1"}};
    const auto participant = Participant::open({.domain = domain++, .config = networkConfig(network)});
    EXPECT_TRUE(participant) << participant.error().what;
  }
}

TEST(NetworkConfig, OfTheUserPrevails) {
  const ScopedVariable uri(
      "CYCLONEDDS_URI",
      "<CycloneDDS><Domain><Discovery><SPDPInterval>7 s</SPDPInterval></Discovery></Domain></CycloneDDS>");
  const Network network{Reach::kWan, "wan", "lo", "127.0.0.1/8", {}};
  const std::string config = networkConfig(network);
  EXPECT_LT(config.find("<SPDPInterval>1 s"), config.find("<SPDPInterval>7 s"));
  const auto participant = Participant::open({.domain = 212, .config = config});
  EXPECT_TRUE(participant) << participant.error().what;
}

TEST(ChosenNetwork, IsThatOfTheEnvironmentElseLoopback) {
  {
    const ScopedVariable network("TENON_NETWORK", "nowhere");
    const auto chosen = chosenNetwork();
    ASSERT_FALSE(chosen);
    EXPECT_THAT(chosen.error().what, HasSubstr("TENON_NETWORK: network 'nowhere'"));
  }
  const auto chosen = chosenNetwork();
  ASSERT_TRUE(chosen) << chosen.error().what;
  EXPECT_EQ(chosen->reach, Reach::kLoopback);
  const ScopedVariable uri("CYCLONEDDS_URI", "file:///none.xml");
  EXPECT_EQ(chosenNetwork()->reach, Reach::kConfig);
  EXPECT_THAT(audienceOf(*chosenNetwork()), HasSubstr("file:///none.xml"));
}

}  // namespace
}  // namespace tenon::wire
