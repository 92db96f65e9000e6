#include "idl/record/mcap_format.h"

#include <array>
#include <charconv>

namespace tenon::record::mcap {
namespace {

constexpr std::array<std::uint32_t, 256> makeTable() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t value = i;
    for (int bit = 0; bit < 8; ++bit) value = (value >> 1U) ^ ((value & 1U) != 0 ? 0xEDB88320U : 0U);
    table[i] = value;
  }
  return table;
}

constexpr std::array<std::uint32_t, 256> kTable = makeTable();

}  // namespace

std::uint32_t crc32(std::span<const std::uint8_t> bytes, std::uint32_t crc) {
  crc = ~crc;
  for (const std::uint8_t byte : bytes) crc = (crc >> 8U) ^ kTable[(crc ^ byte) & 0xFFU];
  return ~crc;
}

std::string checksumOf(std::string_view title, const std::map<std::string, std::string>& values) {
  FieldWriter fields;
  fields.put(title);
  fields.put(values);
  char text[9] = {};
  constexpr int kBase = 16;
  std::to_chars(text, text + sizeof text - 1, crc32(fields.bytes), kBase);
  return text;
}

bool takeChecksum(std::string_view title, std::map<std::string, std::string>& values) {
  const auto found = values.find(kChecksumKey);
  if (found == values.end()) return true;
  const std::string checksum = found->second;
  values.erase(found);
  return checksum == checksumOf(title, values);
}

}  // namespace tenon::record::mcap
