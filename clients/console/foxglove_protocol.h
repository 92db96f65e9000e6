#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/console/channel.h"
#include "idl/types/messages/commands.h"
#include "idl/types/result.h"

/// The Foxglove WebSocket protocol, version 1, server side: texts are JSON, messages binary and
/// little-endian. Of its optional capabilities there are none. The operations that begin with `desk` or
/// `hand` are ours, and so are `heartbeat`, binary messages of viewers, which are targets of hands, and those
/// of kHandSubscription, which are what hands are shown: public viewers neither send nor get them.
///
/// Threads: pure. Real-time: no.
namespace tenon::console {

/// Both names of one protocol: today's viewers offer one or the other.
inline constexpr std::array<std::string_view, 2> kSubprotocols{"foxglove.sdk.v1", "foxglove.websocket.v1"};

/// The first of kSubprotocols that a list as in Sec-WebSocket-Protocol offers.
[[nodiscard]] std::optional<std::string_view> chooseSubprotocol(std::string_view offered);

[[nodiscard]] std::string serverInfoText(std::string_view name, std::string_view session_id);
[[nodiscard]] std::string advertiseText(const std::vector<Channel>& channels);
/// Says only that the connection is there, since browsers do not show WebSocket pings to pages.
[[nodiscard]] std::string heartbeatText();
enum class StatusLevel { kInfo, kWarning, kError };
[[nodiscard]] std::string statusText(StatusLevel level, std::string_view message);

using SubscriptionId = std::uint32_t;  ///< chosen by the viewer
/// Of what the viewer's own hands are shown; not to be chosen.
inline constexpr SubscriptionId kHandSubscription = 0xFFFFFFFF;

/// What a viewer asks of the instructor's desk, or of the place of somebody who takes part.
struct DeskRequest {
  enum class Kind { kSit, kLeave, kCommand, kTakePart, kLeaveHands };
  Kind kind = Kind::kCommand;
  std::uint32_t id = 0;            ///< chosen by the viewer, for the answer
  std::string role;                ///< of kSit, kTakePart: a name of roleName()
  std::string name;                ///< likewise: for display
  std::string key;                 ///< likewise: the session's, or the pass of this gateway; may be empty
  std::vector<std::string> words;  ///< of kCommand: as `tenon command` takes them
  /// Of the command `clear`: NewestRaise::number, of which its sender was told; none: of what the gateway
  /// hears.
  std::optional<std::uint32_t> newest_raise;
  std::vector<std::string> hands;  ///< of kTakePart: names in the scenario

  [[nodiscard]] bool isOfHands() const { return kind == Kind::kTakePart || kind == Kind::kLeaveHands; }
};

struct DeskAnswer {
  std::uint32_t id = 0;  ///< of the request; 0: nobody asked
  bool accepted = false;
  std::string text;  ///< reason, or what came of it; may be empty when accepted
  std::string role;  ///< that the viewer has now; empty: none
  bool is_of_hands = false;
  /// Of a refusal, for pages that have their own text for it: refusalName(), or empty.
  std::string code;
  /// Of a seat that is granted: the words of kCommand that its role may use, with the bit of each in
  /// RunState::open_commands; none where it is the gateway that carries the command out.
  std::vector<std::pair<std::string, std::optional<CommandKind>>> commands;
};
[[nodiscard]] std::string deskAnswerText(const DeskAnswer& answer);

/// What a viewer asks for.
struct ViewerRequest {
  std::optional<DeskRequest> desk;
  std::vector<std::pair<SubscriptionId, ChannelId>> subscribe;
  std::vector<SubscriptionId> unsubscribe;
};

/// Fails with a sentence for the viewer when `text` is no request of this protocol or one that is not
/// offered.
[[nodiscard]] Result<ViewerRequest> parseViewerText(std::string_view text);

/// What precedes the payload in a binary message: opcode 1, subscription, time [ns].
using MessageHeader = std::array<std::uint8_t, 13>;
[[nodiscard]] MessageHeader messageHeader(SubscriptionId subscription, std::int64_t time_ns);

}  // namespace tenon::console
