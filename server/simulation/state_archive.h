#pragma once

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

namespace tenon {

/// One list of fields, three uses: `Derived` writes, reads or hashes numbers one by one, this base takes the
/// values of the simulation apart into numbers. So nothing can be saved and not hashed, or written and not
/// read.
template <typename Derived>
class StateArchive {
 public:
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
    visit(cell.F_Bo_W);
    visit(cell.stamp);
    visit(cell.source);
    visit(cell.lifetime_ticks);
  }
  template <typename C>
  requires std::is_same_v<std::remove_const_t<C>, QueryCounts>
  void visit(C& counts) {
    visit(counts.spheres_visited);
    visit(counts.spheres_total);
    visit(counts.points_visited);
    visit(counts.points_colliding);
    visit(counts.contacts_dropped);
  }
  /// What is not also a member of CollPair.
  template <typename R>
  requires std::is_same_v<std::remove_const_t<R>, IslandPairResult>
  void visit(R& result) {
    visit(result.F_Ao_W);
    static_cast<Derived*>(this)->count(result.query.contacts);
    for (std::size_t i = 0; i < result.query.contacts.size(); ++i) {
      auto& contact = result.query.contacts[i];
      visit(contact.p_WP);
      visit(contact.n_W);
      visit(contact.gap);
      visit(contact.area);
      visit(contact.point);
      visit(result.multipliers[i]);
    }
    visit(result.query.listed_to);
    visit(result.query.others_gap);
    visit(result.query.thinned);
    visit(result.walked.done);
    visit(result.walked.X_WA);
    visit(result.walked.X_WB);
    visit(result.walked.levels);
    visit(result.walked.used);
    visit(result.flanks);
    visit(result.slides);
  }
};

/// Appends to bytes. Numbers are stored as this machine has them: checkpoints belong to one build.
class StateWriter : public StateArchive<StateWriter> {
 public:
  static constexpr bool kReads = false;
  explicit StateWriter(std::vector<std::uint8_t>& bytes) : bytes_(&bytes) {}

  template <typename T>
  void number(const T& value) {
    const auto* first = reinterpret_cast<const std::uint8_t*>(&value);
    bytes_->insert(bytes_->end(), first, first + sizeof(T));
  }
  void count(const ContactList& contacts) { number(static_cast<std::uint32_t>(contacts.size())); }

 private:
  std::vector<std::uint8_t>* bytes_;
};

/// Reads what StateWriter wrote. Past the end, or on a number that no writer writes, it stops being ok() and
/// leaves everything as it is.
class StateReader : public StateArchive<StateReader> {
 public:
  static constexpr bool kReads = true;
  explicit StateReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  template <typename T>
  void number(T& value) {
    ok_ = ok_ && bytes_.size() >= sizeof(T);
    if (!ok_) return;
    if constexpr (std::is_same_v<T, bool>) {
      ok_ = bytes_[0] <= 1;
      value = ok_ && bytes_[0] == 1;
    } else {
      std::memcpy(&value, bytes_.data(), sizeof(T));
    }
    bytes_ = bytes_.subspan(sizeof(T));
  }
  void count(ContactList& contacts) {
    std::uint32_t size = 0;
    number(size);
    ok_ = ok_ && size <= ContactList::capacity();
    contacts.resize(ok_ ? size : 0);
  }
  /// What was read cannot be.
  void refuse() { ok_ = false; }
  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] bool atEnd() const { return ok_ && bytes_.empty(); }

 private:
  std::span<const std::uint8_t> bytes_;
  bool ok_ = true;
};

/// Hashes. Real-time.
class StateHasher : public StateArchive<StateHasher> {
 public:
  static constexpr bool kReads = false;
  template <typename T>
  void number(const T& value) {
    if constexpr (std::is_floating_point_v<T>) {
      hash_.add(static_cast<double>(value));
    } else {
      hash_.add(static_cast<std::uint64_t>(value));
    }
  }
  void count(const ContactList& contacts) { number(contacts.size()); }
  [[nodiscard]] std::uint64_t value() const { return hash_.value(); }

 private:
  StateHash hash_;
};

}  // namespace tenon
