#pragma once

#include <cstdint>
#include <map>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "clients/console/channel.h"
#include "clients/foxglove/displayed_scene.h"
#include "idl/types/messages.h"
#include "idl/wire/assets.h"
#include "idl/wire/raw_subscriber.h"

namespace tenon::console {

/// How the gateway stands to its session, for the page.
enum class LinkState { kSearching, kJoined, kRefused, kLost, kEnded };

/// Turns what a session publishes into messages of channels: its topics as they are, and beside them what
/// public viewers display by themselves (frames at /tf, models at /scene, events at /log). The channel
/// /console says how the gateway stands to its session.
///
/// Threads: one. Real-time: no.
class SessionChannels {
 public:
  explicit SessionChannels(wire::AssetStore assets);

  [[nodiscard]] const std::vector<Channel>& channels() const { return channels_; }
  /// The topics that are forwarded: the tiers _30 and _100, states and events; nothing that clients prove
  /// themselves with, nothing at 1 kHz.
  [[nodiscard]] static std::vector<std::string> topics();

  /// A session begins: what was known of the one before is forgotten.
  void begin(const SessionAnnounce& announce, std::int64_t now_ns);
  /// `is_recorded`: by this gateway.
  void setState(LinkState state, const std::string& reason, bool is_recorded, std::int64_t now_ns);
  void receive(const wire::RawSample& sample);
  /// What is to be published since the last call.
  [[nodiscard]] std::vector<Publication> take();
  /// The run of the session has ended: it is not lost when its server goes.
  [[nodiscard]] bool isOver() const { return is_over_; }

 private:
  void publish(std::string_view topic, std::uint64_t instance, std::int64_t time_ns,
               std::vector<std::uint8_t> bytes, std::uint64_t writer = 0);

  foxglove::DisplayedScene view_;
  std::vector<Channel> channels_;
  std::map<std::string, ChannelId, std::less<>> ids_;  ///< by topic
  std::vector<Publication> published_;

  SessionAnnounce announce_;
  /// of this gateway, of the sessions that it has begun: a page that comes back to another gateway forgets
  std::uint32_t lives_ = std::random_device{}();
  bool is_over_ = false;
};

}  // namespace tenon::console
