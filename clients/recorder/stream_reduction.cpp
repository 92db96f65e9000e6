#include "clients/recorder/stream_reduction.h"

#include <utility>

#include "idl/wire/topics.h"

namespace tenon::recorder {
namespace {

constexpr Tick kManifoldPeriod = 10;        // [ticks]
constexpr Tick kCheckpointPeriod = 10'000;  // [ticks]
constexpr std::size_t kInputsPacked =
    250;  // [ticks] what a recorder that is killed may lose beside its chunk

}  // namespace

bool StreamReduction::isOmitted(std::string_view topic) {
  return topic == wire::kWorldFrame1k.name || topic == wire::kDeviceInput.name;
}

bool StreamReduction::isCopy(std::string_view topic) { return topic == wire::kHandManifold50.name; }

bool StreamReduction::keeps(const HandManifold& manifold, const wire::RawSample& sample, const Write& write) {
  Candidate& strongest = strongest_[manifold.hand];
  const double force = manifold.F_Ho_W.force.norm();
  const bool is_same_period = manifold.tick / kManifoldPeriod == strongest.tick / kManifoldPeriod;
  if (is_same_period && !(force > strongest.force)) return false;
  if (!is_same_period) StreamReduction::write(strongest, write);
  strongest = {manifold.tick, force, sample.source_ns, sample.sequence, {}};
  strongest.bytes.assign(sample.bytes.begin(), sample.bytes.end());
  return false;
}

void StreamReduction::write(const Candidate& candidate, const Write& write) {
  if (candidate.bytes.empty()) return;
  write({.topic = wire::kHandManifold.name,
         .type = wire::typeName<HandManifold>(),
         .source_ns = candidate.source_ns,
         .sequence = candidate.sequence,
         .bytes = candidate.bytes},
        candidate.tick);
}

/// An input of which a part is missing is skipped: it could not be used.
bool StreamReduction::keeps(const TickInputPart& part, const wire::RawSample& sample, const Write& write) {
  if (part.part == 0) {
    joined_ = {part.tick, part.state_hash, {}};
    next_part_ = 0;
  }
  if (part.tick != joined_.tick || part.part != next_part_) return false;
  joined_.bytes.insert(joined_.bytes.end(), part.bytes.begin(), part.bytes.end());
  if (++next_part_ < part.parts) return false;
  needs_checkpoint_ = needs_checkpoint_ || (newest_input_ != 0 && part.tick != newest_input_ + 1);
  newest_input_ = part.tick;
  inputs_.push_back(std::move(joined_));
  inputs_ns_ = sample.source_ns;
  if (inputs_.size() >= kInputsPacked) writeInputs(write);
  return false;
}

bool StreamReduction::keeps(const CheckpointPart& part) {
  if (part.part == 0 &&
      (needs_checkpoint_ || !checkpoint_ || part.tick >= *checkpoint_ + kCheckpointPeriod)) {
    checkpoint_ = part.tick;
    needs_checkpoint_ = false;
  }
  return checkpoint_ == part.tick;
}

void StreamReduction::writeInputs(const Write& write) {
  if (inputs_.empty()) return;
  const auto bytes = record::encodePackedInputs(inputs_);
  write({.topic = record::kPackedInputsTopic,
         .type = record::kPackedInputsType,
         .source_ns = inputs_ns_,
         .sequence = packed_++,
         .bytes = bytes},
        inputs_.back().tick);
  inputs_.clear();
}

void StreamReduction::finish(const Write& write) {
  for (const auto& [hand, strongest] : strongest_) StreamReduction::write(strongest, write);
  strongest_.clear();
  writeInputs(write);
  newest_input_ = 0;
  needs_checkpoint_ = true;
}

}  // namespace tenon::recorder
