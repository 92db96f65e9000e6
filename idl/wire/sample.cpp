#include "idl/wire/sample.h"

#include <bit>
#include <cstring>

#include <dds/ddsi/ddsi_cdrstream.h>

namespace tenon::wire {
namespace {

constexpr std::size_t kHeader = 4;
constexpr std::uint8_t kLittleEndian = 1;  ///< second byte of the encapsulation: CDR_LE; CDR_BE is 0
constexpr std::uint32_t kXcdr1 = 1;
static_assert(std::endian::native == std::endian::little, "encodeSample writes native byte order");

}  // namespace

void encodeSample(const dds_topic_descriptor_t& type, const void* sample, std::vector<std::uint8_t>& bytes) {
  dds_ostream_t stream;
  dds_ostream_init(&stream, 256, kXcdr1);
  dds_stream_write(&stream, static_cast<const char*>(sample), type.m_ops);
  // RTPS pads to four bytes; the number of padding bytes is in the header
  const std::size_t padding = (4 - stream.m_index % 4) % 4;
  bytes.assign({0, kLittleEndian, 0, static_cast<std::uint8_t>(padding)});
  bytes.insert(bytes.end(), stream.m_buffer, stream.m_buffer + stream.m_index);
  bytes.insert(bytes.end(), padding, 0);
  dds_ostream_fini(&stream);
}

OwnedSample::OwnedSample(const dds_topic_descriptor_t& type) : type_(type), memory_(dds_alloc(type.m_size)) {
  std::memset(memory_, 0, type.m_size);
}

OwnedSample::~OwnedSample() {
  dds_stream_free_sample(memory_, type_.m_ops);
  dds_free(memory_);
}

bool OwnedSample::decode(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < kHeader || bytes[0] != 0 || bytes[1] > kLittleEndian) return false;
  const std::size_t padding = bytes[3] & 3U;
  if (bytes.size() < kHeader + padding) return false;
  const std::size_t size = bytes.size() - kHeader - padding;
  // an aligned copy, which is converted to native byte order in place
  std::vector<std::uint64_t> body((size + 7) / 8 + 1, 0);
  std::memcpy(body.data(), bytes.data() + kHeader, size);
  std::uint32_t used = 0;
  const auto body_size = static_cast<std::uint32_t>(size);
  if (dds_stream_normalize_data(reinterpret_cast<char*>(body.data()), &used, body_size,
                                bytes[1] != kLittleEndian, kXcdr1, type_.m_ops) == nullptr ||
      used != body_size) {
    return false;
  }
  dds_istream_t stream;
  dds_istream_init(&stream, body_size, body.data(), kXcdr1);
  dds_stream_read(&stream, static_cast<char*>(memory_), type_.m_ops);
  dds_istream_fini(&stream);
  return true;
}

}  // namespace tenon::wire
