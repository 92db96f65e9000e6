#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace tenon::console {

using ChannelId = std::uint32_t;  ///< as viewers see it, from 1

/// What a viewer can miss of a channel.
enum class Delivery {
  kNewest,  ///< of each instance the newest message counts; late subscribers get it
  kEach,    ///< each message counts; late subscribers get the last of them
};

/// A stream of messages that viewers subscribe to, in the terms of the Foxglove WebSocket protocol.
struct Channel {
  ChannelId id = 0;
  std::string topic;
  std::string encoding;         ///< "cdr" or "json"
  std::string schema_name;      ///< fully scoped
  std::string schema;           ///< its text
  std::string schema_encoding;  ///< "omgidl" or "jsonschema"
  Delivery delivery = Delivery::kNewest;
};

/// Shared by all viewers that have yet to get it.
using Payload = std::shared_ptr<const std::vector<std::uint8_t>>;

/// A message of a channel.
struct Publication {
  ChannelId channel = 0;
  /// of Delivery::kNewest: equal for messages of equal keys; of Delivery::kEach: for those that count alike
  std::uint64_t instance = 0;
  std::int64_t time_ns = 0;  ///< [ns] since 1970, of its writer
  Payload payload;           ///< null: the instance ended, late subscribers do not get it any more
  std::uint64_t writer = 0;  ///< equal for messages of one writer; 0: this program
};

}  // namespace tenon::console
