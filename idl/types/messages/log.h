#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "idl/types/ids.h"

/// Log entries of the server and of clients, and what the server published.
namespace tenon {

enum class Severity : std::uint32_t { kInfo, kWarning, kError };

/// Log entry of the server.
struct EventLog {
  std::uint64_t seq = 0;  ///< rises; jumps when a killed server is resumed
  Tick tick = 0;
  Severity severity = Severity::kInfo;
  std::string kind;  ///< "step", "mounted", "put in place", "taken", "join", "refused", "hand frozen",
                     ///< "emergency stop", ...
  std::string text;
};

/// Log entry of a client.
struct ClientEvent {
  ClientId client;
  std::uint64_t seq = 0;
  Tick tick = 0;  ///< newest that the client had received when it happened
  std::string kind;
  std::string text;
};

/// Number of samples of one topic.
struct TopicSamples {
  std::string topic;
  std::uint64_t samples = 0;
};

/// How many samples the server wrote in a period of ticks, so that a recorder knows what it misses. Periods
/// begin at tick 1 and are kPublishedSamplesPeriod long, the last one of a run up to that; of topics whose
/// samples carry their tick.
struct PublishedSamples {
  Tick first_tick = 1;
  Tick last_tick = 0;
  std::vector<TopicSamples> topics;
};
inline constexpr Tick kPublishedSamplesPeriod = 1000;  ///< [ticks]

}  // namespace tenon
