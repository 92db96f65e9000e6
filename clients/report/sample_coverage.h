#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "idl/types/ids.h"
#include "idl/types/messages/log.h"

namespace tenon::report {

/// How many samples of a topic are in a recording, and how many of them the server has published.
struct SampleCount {
  std::uint64_t recorded = 0, published = 0;

  [[nodiscard]] std::uint64_t missing() const { return published > recorded ? published - recorded : 0; }
  /// More than figures of the topic should rest on.
  [[nodiscard]] bool isSubstantial() const { return 20 * missing() > published; }
};

/// What a recording lacks of the streams that figures rest on, by what the server says that it published in
/// each period (PublishedSamples). A period of which it says nothing lacks nothing, nor does one that began
/// before the first sample: the recorder was not there yet.
///
/// Threads: one. Real-time: no.
class SampleCoverage {
 public:
  void add(const PublishedSamples& published);
  /// A sample of a topic whose samples are recorded as they are.
  void addSample(std::string_view topic, Tick tick);
  /// A HandManifold; a recorder may keep one of 10 ticks of each hand.
  void addManifold(HandId hand, Tick tick);

  /// Of the periods that overlap the ticks from `first` to `last`.
  [[nodiscard]] SampleCount between(std::string_view topic, Tick first, Tick last) const;

 private:
  [[nodiscard]] static Tick periodOf(Tick tick) {
    return tick == 0 ? 0 : (tick - 1) / kPublishedSamplesPeriod;
  }
  struct Period {
    Tick first_tick = 0;
    std::map<std::string, std::uint64_t, std::less<>> published;
  };

  std::map<Tick, Period> periods_;
  std::map<std::string, std::map<Tick, std::uint64_t>, std::less<>> recorded_;  ///< by topic and period
  std::map<HandId, Tick> newest_manifold_;                                      ///< [10 ticks]
  Tick first_ = 0;                                                              ///< of all samples; 0: none
};

}  // namespace tenon::report
