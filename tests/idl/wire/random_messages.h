#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <type_traits>
#include <vector>

#include "idl/wire/convert.h"
#include "idl/wire/fields.h"

namespace tenon::test {

template <class E>
inline constexpr std::uint32_t kEnumerators = 0;  ///< of an enumeration of tenon.idl
#define TENON_ENUMERATORS(E, COUNT) \
  template <>                       \
  inline constexpr std::uint32_t kEnumerators<::tenon_##E> = COUNT;
TENON_WIRE_ENUMERATIONS(TENON_ENUMERATORS)
#undef TENON_ENUMERATORS

/// Fills any message with random values: finite numbers, valid and invalid ids, every enumerator, texts and
/// lists up to their bounds. With `full`, all texts and lists have their maximum length. The fields are those
/// of idl/wire/fields.h, so a new message needs nothing here.
///
/// Threads: one. Real-time: no.
class RandomMessages {
 public:
  explicit RandomMessages(std::uint64_t seed, bool full = false) : random_(seed), full_(full) {}

  template <class M>
  M make() {
    M m;
    const typename wire::TypeOf<M>::C bounds{};
    wire::fields(*this, bounds, m);
    return m;
  }

  // ---- the direction of idl/wire/fields.h: of `c` only the type matters, which has the bounds

  template <class C, class M>
  void operator()(const char*, const C&, M& m) {
    if constexpr (std::is_enum_v<M>) {
      static_assert(kEnumerators<C> > 0);
      m = static_cast<M>(below(kEnumerators<C>));
    } else if constexpr (std::is_same_v<M, std::string>) {
      text(m, std::is_array_v<C> ? std::extent_v<C> - 1 : wire::kKeyTextMax);
    } else {
      fill(m);
    }
  }
  void status(const char*, const std::uint8_t&, std::uint8_t& m) {
    m = static_cast<std::uint8_t>(below(static_cast<std::uint32_t>(ObjectStatus::kFree) + 1));
  }
  template <class C, class Vector>
  void steps(const char*, const C&, Vector& m, double step) {
    for (int i = 0; i < m.size(); ++i) m[i] = fromSteps(static_cast<std::int32_t>(below(0xFFFFFFFF)), step);
  }
  template <class C>
  void bytes(const char*, const C&, std::vector<std::uint8_t>& m, std::size_t bound) {
    m.resize(upTo(bound));
    for (std::uint8_t& byte : m) fill(byte);
  }
  template <class C, class List, class Each>
  void list(const char*, const C&, List& m, std::size_t bound, Each each) {
    const std::remove_pointer_t<decltype(C::_buffer)> element{};
    m.clear();
    m.resize(upTo(bound));
    for (std::size_t i = 0; i < m.size(); ++i) each(*this, element, m[i]);
  }

 private:
  std::uint32_t below(std::uint32_t bound) { return static_cast<std::uint32_t>(random_() % bound); }
  std::size_t upTo(std::size_t max) { return full_ ? max : random_() % (max + 1); }

  void fill(bool& x) { x = below(2) == 1; }
  void fill(std::uint8_t& x) { x = static_cast<std::uint8_t>(below(256)); }
  void fill(std::uint32_t& x) { x = static_cast<std::uint32_t>(random_()); }
  void fill(std::uint64_t& x) { x = random_(); }
  void fill(std::int64_t& x) { x = static_cast<std::int64_t>(random_()); }
  void fill(float& x) {
    do x = std::bit_cast<float>(static_cast<std::uint32_t>(random_()));
    while (!std::isfinite(x));
  }
  void fill(double& x) {
    do x = std::bit_cast<double>(random_());
    while (!std::isfinite(x));
  }
  template <class S, int R>
  void fill(Eigen::Matrix<S, R, 1>& v) {
    for (int i = 0; i < R; ++i) fill(v[i]);
  }
  template <class S, std::size_t N>
  void fill(std::array<S, N>& list) {
    for (S& x : list) fill(x);
  }
  template <class Tag>
  void fill(Id<Tag>& id) {
    if (below(4) == 0)
      id = {};
    else
      fill(id.value);
  }
  void text(std::string& s, std::size_t max) {
    s.clear();
    for (std::size_t size = upTo(max); s.size() < size;) s += static_cast<char>(1 + below(255));
  }

  std::mt19937_64 random_;
  bool full_;
};

}  // namespace tenon::test
