#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

#include "idl/types/hash.h"
#include "idl/types/ids.h"
#include "idl/types/spatial.h"
#include "server/collision/island_solver.h"
#include "server/simulation/force_buffer.h"

namespace tenon::simulation {

/// Traversal of the simulation state for serialisation and hashing. This base splits the types of the
/// simulation into numbers; `Derived` writes, reads or hashes a number. One list of fields serves all three,
/// so what is saved is also hashed and restored.
///
/// Threads: one. Real-time: hashing; writing while the capacity suffices.
template <typename Derived>
class StateArchive {
 public:
  static constexpr bool kHashes = false;
  template <typename T>
  void operator()(T& value) {
    visit(value);
  }

 protected:
  template <typename T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void visit(T& number) { static_cast<Derived*>(this)->number(number); }
  template <typename V>
  requires std::is_same_v<std::remove_const_t<V>, Vector3>
  void visit(V& v) {
    for (int i = 0; i < 3; ++i) visit(v[i]);
  }
  template <typename P>
  requires std::is_same_v<std::remove_const_t<P>, Pose>
  void visit(P& X) {
    visit(X.translation());
    for (int i = 0; i < 4; ++i) visit(X.rotation().coeffs()[i]);
  }
  template <typename V>
  requires std::is_same_v<std::remove_const_t<V>, Twist>
  void visit(V& twist) {
    visit(twist.linear);
    visit(twist.angular);
  }
  template <typename F>
  requires std::is_same_v<std::remove_const_t<F>, Wrench>
  void visit(F& wrench) {
    visit(wrench.force);
    visit(wrench.torque);
  }
  template <typename I>
  requires std::is_same_v<std::remove_const_t<I>, ObjectId> || std::is_same_v<std::remove_const_t<I>, HandId>
  void visit(I& id) { visit(id.value); }
  template <typename C>
  requires std::is_same_v<std::remove_const_t<C>, ForceCell>
  void visit(C& cell) {
    visit(cell.used);
    if (!cell.used) return;
    visit(cell.F_Bq_W);
    visit(cell.stamp);
    visit(cell.source);
    visit(cell.lifetime_ticks);
  }
  template <typename C>
  requires std::is_same_v<std::remove_const_t<C>, collision::QueryCounts>
  void visit(C& counts) {
    visit(counts.spheres_visited);
    visit(counts.spheres_total);
    visit(counts.points_visited);
    visit(counts.points_colliding);
    visit(counts.contacts_dropped);
  }
  /// The members of IslandPairResult that CollPair does not archive as its own.
  template <typename R>
  requires std::is_same_v<std::remove_const_t<R>, collision::IslandPairResult>
  void visit(R& result) {
    visit(result.F_Ao_W);
    static_cast<Derived*>(this)->count(result.query.contacts);
    for (std::size_t i = 0; i < result.query.contacts.size(); ++i) {
      auto& contact = result.query.contacts[i];
      visit(contact.p_WP);
      visit(contact.n_W);
      visit(contact.gap);
      visit(contact.area);
      visit(contact.kind);
      visit(contact.point);
      if (contact.kind == collision::ContactKind::kCrossing) visit(contact.other);
      visit(result.multipliers[i]);
    }
    visit(result.query.complete_to);
    visit(result.query.unlisted_gap);
    visit(result.query.reduced);
    visit(result.traversal.valid);
    visit(result.traversal.X_WA);
    visit(result.traversal.X_WB);
    visit(result.traversal.smallest_gap);
    visit(result.traversal.levels);
    visit(result.traversal.levels_used);
    visit(result.secondary_planes);
    visit(result.slides);
  }
};

/// Appends to `bytes` in the machine's own representation: a checkpoint is valid for one build only.
class ArchiveWriter : public StateArchive<ArchiveWriter> {
 public:
  static constexpr bool kReads = false;
  explicit ArchiveWriter(std::vector<std::uint8_t>& bytes) : bytes_(&bytes) {}

  template <typename T>
  void number(const T& value) {
    const auto* first = reinterpret_cast<const std::uint8_t*>(&value);
    bytes_->insert(bytes_->end(), first, first + sizeof(T));
  }
  void count(const collision::ContactList& contacts) { number(static_cast<std::uint32_t>(contacts.size())); }

 private:
  std::vector<std::uint8_t>* bytes_;
};

/// Reads what ArchiveWriter wrote. After the end of the bytes or an invalid value ok() is false and nothing
/// more is assigned. No number of a state is infinite or NaN, so such a number is invalid wherever it is.
class ArchiveReader : public StateArchive<ArchiveReader> {
 public:
  static constexpr bool kReads = true;
  explicit ArchiveReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  template <typename T>
  void number(T& value) {
    ok_ = ok_ && bytes_.size() >= sizeof(T);
    if (!ok_) return;
    if constexpr (std::is_same_v<T, bool>) {
      ok_ = bytes_[0] <= 1;
      value = ok_ && bytes_[0] == 1;
    } else {
      T read;
      std::memcpy(&read, bytes_.data(), sizeof(T));
      if constexpr (std::is_floating_point_v<T>) finite_ = ok_ = std::isfinite(read);
      if (ok_) value = read;
    }
    bytes_ = bytes_.subspan(sizeof(T));
  }
  void count(collision::ContactList& contacts) {
    std::uint32_t size = 0;
    number(size);
    ok_ = ok_ && size <= collision::ContactList::capacity();
    contacts.resize(ok_ ? size : 0);
  }
  /// The caller found an invalid value.
  void reject() { ok_ = false; }
  [[nodiscard]] bool ok() const { return ok_; }
  /// False after a number that is infinite or NaN.
  [[nodiscard]] bool finite() const { return finite_; }
  [[nodiscard]] bool atEnd() const { return ok_ && bytes_.empty(); }

 private:
  std::span<const std::uint8_t> bytes_;
  bool ok_ = true;
  bool finite_ = true;
};

/// Lists where ArchiveWriter writes floating-point numbers.
class ArchiveDoubles : public StateArchive<ArchiveDoubles> {
 public:
  static constexpr bool kReads = false;
  template <typename T>
  void number(const T&) {
    if constexpr (std::is_floating_point_v<T>) positions_.push_back(next_);
    next_ += sizeof(T);
  }
  void count(const collision::ContactList&) { next_ += sizeof(std::uint32_t); }
  /// [bytes] from the first number on.
  [[nodiscard]] std::vector<std::size_t> positions() const { return positions_; }

 private:
  std::vector<std::size_t> positions_;
  std::size_t next_ = 0;
};

/// Computes the state hash. Real-time.
class ArchiveHasher : public StateArchive<ArchiveHasher> {
 public:
  static constexpr bool kReads = false;
  static constexpr bool kHashes = true;
  template <typename T>
  void number(const T& value) {
    if constexpr (std::is_floating_point_v<T>) {
      hash_.add(static_cast<double>(value));
    } else {
      hash_.add(static_cast<std::uint64_t>(value));
    }
  }
  void count(const collision::ContactList& contacts) { number(contacts.size()); }
  [[nodiscard]] std::uint64_t value() const { return hash_.value(); }

 private:
  StateHash hash_;
};

}  // namespace tenon::simulation
