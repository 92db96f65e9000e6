#include "idl/wire/convert.h"

#include <algorithm>
#include <concepts>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <utility>

#include "idl/wire/fields.h"

namespace tenon::wire {
namespace {

template <class T>
concept Number = std::is_arithmetic_v<T>;

template <class T>
concept IdNumber = requires(T id) {
  id.value;
  { T::kNone } -> std::convertible_to<std::uint32_t>;
};

/// Copies a message to its C struct and keeps the first field that exceeds its bound.
class ToWire {
 public:
  explicit ToWire(std::span<std::byte> lists) : lists_(lists) {}
  [[nodiscard]] const char* bad_field() const { return bad_field_; }
  [[nodiscard]] std::size_t bad_size() const { return bad_size_; }
  [[nodiscard]] std::size_t bad_bound() const { return bad_bound_; }

  template <Number A, Number B>
  void operator()(const char*, A& c, const B& m) {
    c = m;
  }
  template <class E, class F>
  requires std::is_enum_v<F>
  void operator()(const char*, E& c, const F& m) { c = static_cast<E>(m); }
  template <IdNumber I>
  void operator()(const char*, std::uint32_t& c, const I& m) {
    c = m.value;
  }
  template <Number S, std::size_t N, int R>
  void operator()(const char*, S (&c)[N], const Eigen::Matrix<S, R, 1>& m) {
    static_assert(N == R);
    std::copy_n(m.data(), N, c);
  }
  template <Number S, std::size_t N>
  void operator()(const char*, S (&c)[N], const std::array<S, N>& m) {
    std::copy_n(m.data(), N, c);
  }
  template <std::size_t N>
  void operator()(const char* field, char (&c)[N], const std::string& m) {
    const std::size_t size = checked(field, m, N - 1);
    std::memcpy(c, m.data(), size);
    c[size] = '\0';
  }
  void operator()(const char* field, char*& c, const std::string& m) {
    checked(field, m, kKeyTextMax);
    c = const_cast<char*>(m.c_str());
  }
  void status(const char*, std::uint8_t& c, const std::uint8_t& m) { c = m; }
  template <std::size_t N>
  void steps(const char*, std::int32_t (&c)[N], const Eigen::Matrix<double, int{N}, 1>& m, double step) {
    for (std::size_t i = 0; i < N; ++i) c[i] = toSteps(m[static_cast<int>(i)], step);
  }
  void bytes(const char* field, dds_sequence_octet& c, const std::vector<std::uint8_t>& m,
             std::size_t bound) {
    const std::size_t size = fit(field, m.size(), bound);
    c = {};
    c._maximum = c._length = static_cast<std::uint32_t>(size);
    c._buffer = const_cast<std::uint8_t*>(m.data());
  }
  /// Converts element by element with each(*this, c_element, m_element); storage comes from `lists_`.
  template <class Sequence, class List, class Each>
  void list(const char* field, Sequence& c, const List& m, std::size_t bound, Each each) {
    using Element = std::remove_pointer_t<decltype(c._buffer)>;
    const std::size_t room = lists_.size() / sizeof(Element);
    const std::size_t size = fit(field, m.size(), std::min(bound, room));
    c = {};
    c._maximum = c._length = static_cast<std::uint32_t>(size);
    c._buffer = reinterpret_cast<Element*>(lists_.data());
    for (std::size_t i = 0; i < size; ++i) each(*this, c._buffer[i], m[i]);
    lists_ = lists_.subspan((size * sizeof(Element) + 7) / 8 * 8);
  }

 private:
  std::size_t fit(const char* field, std::size_t size, std::size_t bound) {
    if (size <= bound) return size;
    if (bad_field_ == nullptr) {
      bad_field_ = field;
      bad_size_ = size;
      bad_bound_ = bound;
    }
    return 0;
  }
  std::size_t checked(const char* field, const std::string& text, std::size_t bound) {
    // a zero byte would truncate the text: it is refused like one that is too long
    return fit(field, text.size(), text.find('\0') == std::string::npos ? bound : text.find('\0'));
  }

  std::span<std::byte> lists_;
  const char* bad_field_ = nullptr;
  std::size_t bad_size_ = 0;
  std::size_t bad_bound_ = 0;
};

/// Copies a C struct to its message.
class FromWire {
 public:
  [[nodiscard]] bool good() const { return good_; }
  void reject() { good_ = false; }

  template <Number A, Number B>
  void operator()(const char*, const A& c, B& m) {
    m = c;
  }
  void operator()(const char*, const bool& c, bool& m) {
    unsigned char byte = 0;  // a received bool may have any byte value
    std::memcpy(&byte, &c, 1);
    m = byte != 0;
  }
  template <class E, class F>
  requires std::is_enum_v<F>
  void operator()(const char*, const E& c, F& m) { m = static_cast<F>(c); }
  template <IdNumber I>
  void operator()(const char*, const std::uint32_t& c, I& m) {
    m.value = c;
  }
  template <Number S, std::size_t N, int R>
  void operator()(const char*, const S (&c)[N], Eigen::Matrix<S, R, 1>& m) {
    static_assert(N == R);
    std::copy_n(c, N, m.data());
  }
  template <Number S, std::size_t N>
  void operator()(const char*, const S (&c)[N], std::array<S, N>& m) {
    std::copy_n(c, N, m.data());
  }
  template <std::size_t N>
  void operator()(const char*, const char (&c)[N], std::string& m) {
    m.assign(c, strnlen(c, N));
  }
  void operator()(const char*, char* const& c, std::string& m) {
    m.assign(c == nullptr ? "" : c);
    if (m.size() > kKeyTextMax) reject();
  }
  void status(const char*, const std::uint8_t& c, std::uint8_t& m) {
    m = c;
    if (m > static_cast<std::uint8_t>(ObjectStatus::kFree)) reject();
  }
  template <std::size_t N>
  void steps(const char*, const std::int32_t (&c)[N], Eigen::Matrix<double, int{N}, 1>& m, double step) {
    for (std::size_t i = 0; i < N; ++i) m[static_cast<int>(i)] = fromSteps(c[i], step);
  }
  void bytes(const char*, const dds_sequence_octet& c, std::vector<std::uint8_t>& m, std::size_t bound) {
    if (c._length > bound) return reject();
    m.assign(c._buffer, c._buffer + c._length);
  }
  template <class Sequence, class List, class Each>
  void list(const char*, const Sequence& c, List& m, std::size_t bound, Each each) {
    m.clear();
    if (c._length > bound) return reject();
    m.resize(c._length);
    for (std::size_t i = 0; i < c._length; ++i) each(*this, std::as_const(c._buffer[i]), m[i]);
  }

 private:
  bool good_ = true;
};

}  // namespace

template <class M>
Result<void> toWire(const M& message, Wire<M>& wire) {
  ToWire direction(wire.lists);
  fields(direction, wire.sample, message);
  if (direction.bad_field() == nullptr) return {};
  return fail(std::string(TypeOf<M>::descriptor().m_typename) + ": '" + direction.bad_field() + "' has " +
              std::to_string(direction.bad_size()) + " bytes or entries, only the first " +
              std::to_string(direction.bad_bound()) + " can be sent");
}

template <class M>
bool fromWire(const typename TypeOf<M>::C& sample, M& message) {
  FromWire direction;
  fields(direction, sample, message);
  return direction.good();
}

#define TENON_INSTANTIATE(M)                           \
  template Result<void> toWire<M>(const M&, Wire<M>&); \
  template bool fromWire<M>(const TypeOf<M>::C&, M&);
TENON_WIRE_MESSAGES(TENON_INSTANTIATE)
#undef TENON_INSTANTIATE

}  // namespace tenon::wire
