#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <dds/dds.h>

/// CDR serialisation of any type of tenon.idl by its topic descriptor. Internal to idl/wire.
namespace tenon::wire {

/// Replaces `bytes` by the serialised sample, encapsulation header included.
void encodeSample(const dds_topic_descriptor_t& type, const void* sample, std::vector<std::uint8_t>& bytes);

/// A C struct of `type` and all memory it points to.
class OwnedSample {
 public:
  explicit OwnedSample(const dds_topic_descriptor_t& type);
  ~OwnedSample();
  OwnedSample(const OwnedSample&) = delete;
  OwnedSample& operator=(const OwnedSample&) = delete;
  [[nodiscard]] void* get() const { return memory_; }

  /// Deserialises `bytes`; false unless they are one complete, valid sample of the type.
  bool decode(std::span<const std::uint8_t> bytes);

 private:
  const dds_topic_descriptor_t& type_;
  void* memory_;
};

}  // namespace tenon::wire
