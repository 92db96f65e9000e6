#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <dds/dds.h>

/// CDR of any of our types, from the marshalling program that idlc wrote into the type's descriptor.
/// Internal to idl/wire.
namespace tenon::wire {

/// Appends nothing to, but replaces, `bytes`.
void encodeSample(const dds_topic_descriptor_t& type, const void* sample, std::vector<std::uint8_t>& bytes);

/// A C struct that owns what it points to.
class OwnedSample {
 public:
  explicit OwnedSample(const dds_topic_descriptor_t& type);
  ~OwnedSample();
  OwnedSample(const OwnedSample&) = delete;
  OwnedSample& operator=(const OwnedSample&) = delete;
  [[nodiscard]] void* get() const { return memory_; }

  /// Fills it from bytes; false when they are not a whole, valid sample of the type.
  bool decode(std::span<const std::uint8_t> bytes);

 private:
  const dds_topic_descriptor_t& type_;
  void* memory_;
};

}  // namespace tenon::wire
