#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.h"

/// Which machines a program exchanges samples with: what `--network` and TENON_NETWORK choose
/// (docs/network.md).
namespace tenon::wire {

enum class Reach : std::uint8_t {
  kLoopback,  ///< this machine
  kLan,       ///< one local network: multicast finds the others, and peers that are named
  kWan,       ///< routes or a VPN: unicast between programs that know each other's address
  kConfig,    ///< what CYCLONEDDS_URI says
};

struct Network {
  Reach reach = Reach::kLoopback;
  std::string text;                ///< as it was chosen, for messages
  std::string interface;           ///< name, as `ip link` prints it; empty for kConfig
  std::string address;             ///< IPv4 of the interface, and the length of its prefix, as in 10.0.0.5/24
  std::vector<std::string> peers;  ///< IPv4 addresses
};

/// `loopback`, `lan`, `wan`, or the name of an interface (lan if it can multicast, else wan, as WireGuard's),
/// with peers behind it: `wan,server.example,10.0.0.7`. Without an interface: that of the route to the first
/// peer; without peers that of the default route, or the only one. Fails with a sentence that names the
/// choice and what to do: unknown interface, peer or word, no interface, peers of loopback, a peer that is no
/// other machine.
[[nodiscard]] Result<Network> findNetwork(std::string_view text);

/// Fails where CYCLONEDDS_URI, which prevails, names the interface of loopback for a network beyond it: DDS
/// cannot send from there to another machine.
[[nodiscard]] Result<void> checkAgainstUri(const Network& network);

/// Chooses the network of all participants that this process opens from now on; fails as findNetwork and
/// checkAgainstUri.
/// DDS configures a domain once per process, so the choice comes before the first participant.
/// Threads: one at a time, before others open participants.
[[nodiscard]] Result<void> chooseNetwork(std::string_view text);

/// What was chosen; else TENON_NETWORK; else CYCLONEDDS_URI as it is; else loopback. Fails as chooseNetwork.
[[nodiscard]] Result<Network> chosenNetwork();

/// Configuration of Cyclone DDS for this network: its profile of deploy/dds, its interface and peers, and
/// CYCLONEDDS_URI, which prevails where it says otherwise.
[[nodiscard]] std::string networkConfig(const Network& network);

/// Who hears a program on this network, as a sentence for a terminal; empty for loopback.
[[nodiscard]] std::string audienceOf(const Network& network);

/// Adds `--network` to a program's command line, an instance of CLI11's App.
template <class App>
void addNetworkOption(App& app) {
  app.add_option_function("--network", std::function<void(const std::string&)>([](const std::string&) {}),
                          "loopback, lan, wan or an interface, and peers: who can be reached; see "
                          "docs/network.md (default: TENON_NETWORK, else loopback)")
      ->check([](const std::string& text) {
        const auto chosen = chooseNetwork(text);
        return chosen ? std::string() : chosen.error().what;
      })
      ->option_text("loopback|lan|wan|IFACE[,PEER...]");
}

}  // namespace tenon::wire
