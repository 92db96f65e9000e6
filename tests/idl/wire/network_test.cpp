#include "idl/wire/network.h"

#include <cstdlib>
#include <string>
#include <utility>

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

TEST(FindNetwork, RefusesPeersThatAreNoOtherMachine) {
  for (const auto& [text, why] : {std::pair("wan,127.0.0.1", "'127.0.0.1' means loopback (127.0.0.1)"),
                                  std::pair("lan,localhost", "'localhost' means loopback (127."),
                                  std::pair("wan,127.0.1.1", "--network loopback"),
                                  std::pair("wan,10.1", "'10.1' is no IPv4 address: four numbers"),
                                  std::pair("wan,10.0.0.256", "'10.0.0.256' is no IPv4 address"),
                                  std::pair("wan,224.0.0.1", "multicast"),
                                  std::pair("wan,0.0.0.0", "'0.0.0.0' is no address of a machine"),
                                  std::pair("lan,255.255.255.255", "is no address of a machine")}) {
    const auto network = findNetwork(text);
    ASSERT_FALSE(network) << text;
    EXPECT_THAT(network.error().what, HasSubstr(std::string("network '") + text + "': the peer "));
    EXPECT_THAT(network.error().what, HasSubstr(why));
  }
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

TEST(CheckAgainstUri, RefusesTheInterfaceOfLoopbackForANetworkBeyondIt) {
  const Network wan{Reach::kWan, "wan", "eth0", "10.0.0.5/24", {}};
  const auto isRefused = [](const Network& network, const std::string& interfaces) {
    const std::string text =
        "<CycloneDDS><Domain><General>" + interfaces + "</General></Domain></CycloneDDS>";
    const ScopedVariable uri("CYCLONEDDS_URI", text.c_str());
    return !checkAgainstUri(network);
  };
  const std::string loopback = "<Interfaces><NetworkInterface name=\"lo\"/></Interfaces>";
  EXPECT_TRUE(isRefused(wan, loopback));
  EXPECT_TRUE(
      isRefused(wan, "<Interfaces><NetworkInterface priority='1' address='127.0.0.1'/></Interfaces>"));
  EXPECT_TRUE(isRefused(wan, "<NetworkInterfaceAddress>lo</NetworkInterfaceAddress>"));
  EXPECT_FALSE(isRefused(wan, "<Interfaces><NetworkInterface name=\"lowpan0\"/></Interfaces>"));
  EXPECT_FALSE(isRefused({Reach::kLoopback, "loopback", "lo", "127.0.0.1/8", {}}, loopback));
  EXPECT_TRUE(checkAgainstUri(wan)) << "without the variable";
}

TEST(Participant, ThatCannotBeOpenedNamesTheVariableThatMayBeWhy) {
  const ScopedVariable uri("CYCLONEDDS_URI", "garbage");
  const auto participant = Participant::open({.domain = 213});
  ASSERT_FALSE(participant);
  EXPECT_THAT(participant.error().what, HasSubstr("could not be opened by CYCLONEDDS_URI, 'garbage'"));
}

}  // namespace
}  // namespace tenon::wire
