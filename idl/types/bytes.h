#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/spatial.h"

namespace tenon {

/// Appends values to a byte vector, unpadded and in native byte order. Allocates only when the vector's
/// capacity is exceeded.
class ByteWriter {
 public:
  explicit ByteWriter(std::vector<std::uint8_t>& bytes) : bytes_(bytes) {}

  template <typename T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void put(T value) {
    const auto at = bytes_.size();
    bytes_.resize(at + sizeof(T));
    std::memcpy(bytes_.data() + at, &value, sizeof(T));
  }
  template <typename Tag>
  void put(Id<Tag> id) {
    put(id.value);
  }
  void put(const Vector3& v) {
    for (int i = 0; i < 3; ++i) put(v[i]);
  }
  void put(const Pose& X) {
    put(X.translation());
    for (int i = 0; i < 4; ++i) put(X.rotation().coeffs()[i]);
  }
  void put(const Twist& V) { put(V.linear), put(V.angular); }
  void put(const Wrench& F) { put(F.force), put(F.torque); }

 private:
  std::vector<std::uint8_t>& bytes_;
};

/// Reads what ByteWriter wrote. Past the end values are zero and ok() stays false: check it once, at the end.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  template <typename T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void get(T& value) {
    value = T{};
    if (bytes_.size() - at_ < sizeof(T)) {
      ok_ = false;
      at_ = bytes_.size();
      return;
    }
    if constexpr (std::is_same_v<T, bool>) {
      value = bytes_[at_] != 0;
    } else {
      std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    }
    at_ += sizeof(T);
  }
  template <typename Tag>
  void get(Id<Tag>& id) {
    get(id.value);
  }
  void get(Vector3& v) {
    for (int i = 0; i < 3; ++i) get(v[i]);
  }
  void get(Pose& X) {
    get(X.translation());
    for (int i = 0; i < 4; ++i) get(X.rotation().coeffs()[i]);
  }
  void get(Twist& V) { get(V.linear), get(V.angular); }
  void get(Wrench& F) { get(F.force), get(F.torque); }

  void skip(std::size_t count) {
    ok_ = ok_ && bytes_.size() - at_ >= count;
    at_ = ok_ ? at_ + count : bytes_.size();
  }

  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] bool atEnd() const { return at_ == bytes_.size(); }
  [[nodiscard]] std::size_t position() const { return at_; }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

}  // namespace tenon
