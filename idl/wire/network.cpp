#include "idl/wire/network.h"

#include <bit>
#include <cstdlib>
#include <memory>
#include <optional>
#include <regex>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "idl/wire/profiles.h"

namespace tenon::wire {
namespace {

struct Interface {
  std::string name;
  std::string address;  ///< IPv4
  int prefix = 0;       ///< [bits]
  bool multicasts = false;
};

std::string textOf(const in_addr& address) {
  char text[INET_ADDRSTRLEN] = "";
  inet_ntop(AF_INET, &address, text, sizeof text);
  return text;
}

/// Those that are up, have an IPv4 address and are not loopback.
std::vector<Interface> interfaces() {
  std::vector<Interface> found;
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) return found;
  const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> owner(list, freeifaddrs);
  for (const ifaddrs* at = list; at != nullptr; at = at->ifa_next) {
    if (at->ifa_addr == nullptr || at->ifa_addr->sa_family != AF_INET) continue;
    constexpr unsigned kUsable = IFF_UP | IFF_RUNNING;
    if ((at->ifa_flags & kUsable) != kUsable || (at->ifa_flags & IFF_LOOPBACK) != 0) continue;
    const auto* const mask = reinterpret_cast<const sockaddr_in*>(at->ifa_netmask);
    found.push_back({.name = at->ifa_name,
                     .address = textOf(reinterpret_cast<const sockaddr_in*>(at->ifa_addr)->sin_addr),
                     .prefix = mask == nullptr ? 32 : std::popcount(mask->sin_addr.s_addr),
                     .multicasts = (at->ifa_flags & IFF_MULTICAST) != 0});
  }
  return found;
}

std::string listOf(const std::vector<Interface>& found) {
  std::string text;
  for (const Interface& one : found) text += (text.empty() ? "" : ", ") + one.name + " (" + one.address + ")";
  return text.empty() ? "none that is up and has an IPv4 address" : text;
}

/// The local address from which packets to `peer` leave; asks the routing table and sends nothing.
std::optional<std::string> sourceTowards(const std::string& peer) {
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket < 0) return std::nullopt;
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(7400);
  inet_pton(AF_INET, peer.c_str(), &to.sin_addr);
  sockaddr_in from{};
  socklen_t size = sizeof from;
  const bool known = connect(socket, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0 &&
                     getsockname(socket, reinterpret_cast<sockaddr*>(&from), &size) == 0;
  close(socket);
  if (!known) return std::nullopt;
  return textOf(from.sin_addr);
}

std::optional<std::string> resolve(const std::string& host) {
  addrinfo wanted{};
  wanted.ai_family = AF_INET;
  wanted.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(host.c_str(), nullptr, &wanted, &found) != 0 || found == nullptr) return std::nullopt;
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> owner(found, freeaddrinfo);
  return textOf(reinterpret_cast<const sockaddr_in*>(found->ai_addr)->sin_addr);
}

/// The address of the peer that `word` names; fails with why it cannot be one.
Result<std::string> peerAddress(const std::string& word) {
  in_addr address{};
  const bool is_number = word.find_first_not_of("0123456789.") == std::string::npos;
  if (is_number && inet_pton(AF_INET, word.c_str(), &address) != 1)
    return fail("'" + word + "' is no IPv4 address: four numbers, as in 10.0.0.5");
  const auto text = resolve(word);
  if (!text)
    return fail("'" + word + "' has no IPv4 address: mistyped, or not known to this machine's name service");
  inet_pton(AF_INET, text->c_str(), &address);
  const std::uint32_t first = ntohl(address.s_addr) >> 24U;
  if (first == 127)
    return fail("'" + word + "' means loopback (" + *text +
                "), which is this machine: leave it out, programs of one machine know each other; for a "
                "session on this machine alone: --network loopback");
  if (first == 0 || first >= 224)
    return fail("'" + word + "' is no address of a machine: " +
                (first >= 224 && first < 240 ? "multicast groups are Tenon's own (--network lan)"
                                             : "name a host, as in 10.0.0.5"));
  return *text;
}

std::vector<std::string> wordsOf(std::string_view text) {
  std::vector<std::string> words(1);
  for (const char letter : text) {
    if (letter == ',')
      words.emplace_back();
    else if (letter != ' ')
      words.back() += letter;
  }
  return words;
}

const Interface* withAddress(const std::vector<Interface>& all, const std::optional<std::string>& address) {
  for (const Interface& one : all)
    if (address && one.address == *address) return &one;
  return nullptr;
}

/// The interface that a network without a named one uses.
Result<Interface> defaultInterface(const std::string& text, const std::vector<std::string>& peers) {
  const std::vector<Interface> all = interfaces();
  if (!peers.empty()) {
    if (const Interface* one = withAddress(all, sourceTowards(peers.front()))) return *one;
    return fail("network '" + text + "': there is no route to the peer " + peers.front() +
                ": start the VPN or mend the route (ip route get " + peers.front() +
                "), then try `tenon doctor --peer " + peers.front() + "`");
  }
  constexpr const char* kElsewhere = "192.0.2.1";  // an address of documentation: the default route's
  if (const Interface* one = withAddress(all, sourceTowards(kElsewhere))) return *one;
  if (all.size() == 1) return all.front();
  return fail(
      "network '" + text + "': " +
      (all.empty()
           ? "no interface is up and has an IPv4 address: connect one, or use --network loopback"
           : "which interface? Name one of " + listOf(all) + ", as in --network " + all.front().name));
}

Result<Interface> namedInterface(const std::string& text, const std::string& name) {
  const std::vector<Interface> all = interfaces();
  for (const Interface& one : all)
    if (one.name == name || one.address == name) return one;
  return fail("network '" + text + "': '" + name +
              "' is neither loopback, lan nor wan, nor an interface of this machine, which has " +
              listOf(all));
}

std::optional<Network>& choice() {
  static std::optional<Network> one;
  return one;
}

const char* environmentText(const char* name) {
  const char* const text = std::getenv(name);
  return text != nullptr && *text != '\0' ? text : nullptr;
}

}  // namespace

Result<Network> findNetwork(std::string_view text) {
  Network network{.text = std::string(text)};
  std::vector<std::string> words = wordsOf(text);
  const std::string first = words.front();
  words.erase(words.begin());
  if (first == "loopback") {
    if (!words.empty())
      return fail("network '" + network.text + "': loopback has no peers: name lan, wan or an interface");
    network.interface = "lo";
    network.address = "127.0.0.1/8";
    return network;
  }
  for (const std::string& word : words) {
    const auto address = peerAddress(word);
    if (!address) return fail("network '" + network.text + "': the peer " + address.error().what);
    network.peers.push_back(*address);
  }
  const bool is_named = first != "lan" && first != "wan";
  const auto interface =
      is_named ? namedInterface(network.text, first) : defaultInterface(network.text, network.peers);
  if (!interface) return tl::unexpected(interface.error());
  network.reach = first == "wan" || (is_named && !interface->multicasts) ? Reach::kWan : Reach::kLan;
  network.interface = interface->name;
  network.address = interface->address + "/" + std::to_string(interface->prefix);
  if (network.reach == Reach::kLan && !interface->multicasts && network.peers.empty())
    return fail("network '" + network.text + "': " + interface->name +
                " has no multicast: name the other machines as peers, as in --network " + interface->name +
                ",10.0.0.5");
  return network;
}

Result<void> checkAgainstUri(const Network& network) {
  const char* const uri = environmentText("CYCLONEDDS_URI");
  if (uri == nullptr || network.reach == Reach::kLoopback) return {};
  static const std::regex kLoopback(
      R"(<NetworkInterface(\s[^>]*\b(name|address)\s*=\s*["'](lo|127\.[0-9.]*)["']|Address>\s*(lo|127\.[0-9.]*)\s*<))");
  if (!std::regex_search(uri, kLoopback)) return {};
  return fail(
      "network '" + network.text +
      "': CYCLONEDDS_URI names the interface of loopback, which reaches no other machine: unset it, or "
      "choose --network loopback");
}

Result<void> chooseNetwork(std::string_view text) {
  auto network = findNetwork(text);
  if (!network) return tl::unexpected(network.error());
  if (auto checked = checkAgainstUri(*network); !checked) return checked;
  choice() = std::move(*network);
  return {};
}

Result<Network> chosenNetwork() {
  if (choice()) return *choice();
  if (const char* text = environmentText("TENON_NETWORK")) {
    auto network = findNetwork(text);
    if (!network) return fail("TENON_NETWORK: " + network.error().what);
    if (auto checked = checkAgainstUri(*network); !checked)
      return fail("TENON_NETWORK: " + checked.error().what);
    return network;
  }
  if (const char* uri = environmentText("CYCLONEDDS_URI")) return Network{Reach::kConfig, uri, {}, {}, {}};
  return findNetwork("loopback");
}

std::string networkConfig(const Network& network) {
  const char* const uri = environmentText("CYCLONEDDS_URI");
  const std::string own = uri == nullptr ? "" : uri;
  if (network.reach == Reach::kConfig) return own;
  const std::string more = own.empty() ? "" : "," + own;
  if (network.reach == Reach::kLoopback) return std::string(loopbackConfig()) + more;
  const bool is_lan = network.reach == Reach::kLan;
  const std::string address = network.address.substr(0, network.address.find('/'));
  // programs of this machine, too, have to be known where there is no multicast
  std::string peers = is_lan ? "" : "<Peer Address=\"" + address + "\"/>";
  for (const std::string& peer : network.peers) peers += "<Peer Address=\"" + peer + "\"/>";
  return std::string(is_lan ? lanConfig() : wanConfig()) +
         ",<CycloneDDS><Domain Id=\"any\"><General><Interfaces><NetworkInterface address=\"" + address +
         "\"/></Interfaces></General>" +
         (peers.empty() ? "" : "<Discovery><Peers>" + peers + "</Peers></Discovery>") +
         "</Domain></CycloneDDS>" + more;
}

std::string audienceOf(const Network& network) {
  switch (network.reach) {
    case Reach::kLoopback:
      return "";
    case Reach::kConfig:
      return "heard by whoever CYCLONEDDS_URI lets in (" + network.text + "); nothing is encrypted";
    case Reach::kLan:
      return "heard on " + network.interface + " by every program in " + network.address +
             (network.peers.empty() ? "" : " and at the peers") + "; nothing is encrypted";
    case Reach::kWan:
      return "heard on " + network.interface + " by every program that can send to " +
             network.address.substr(0, network.address.find('/')) +
             ", UDP ports of docs/network.md; nothing is encrypted but by a VPN";
  }
  return "";
}

}  // namespace tenon::wire
