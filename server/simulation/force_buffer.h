#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "idl/types/ids.h"
#include "idl/types/spatial.h"

namespace tenon::simulation {

/// The wrench of one source, about the body's centre Q.
struct ForceCell {
  Wrench F_Bq_W;
  Tick stamp = 0;                    ///< tick of the last write
  std::uint32_t source = 0;          ///< contributions only: id chosen by the sender
  std::uint32_t lifetime_ticks = 0;  ///< [ticks] 0: valid until overwritten
  bool used = false;
};

/// Accumulates the wrenches of several sources on one object (paper §3.2, iii). All are about its centre Q,
/// that of its bounding sphere: a torque about the origin would grow with the distance from there to the
/// object.
///
/// Every source has one cell and overwrites it. The own cells (pairs, couplings of hands, gravity) come
/// first; they stay valid until overwritten, so a pair skipped by coherence keeps its wrench. Then come cells
/// for contributions of clients, which are validated, clamped, fade linearly with age and expire. Cells are
/// summed in cell order, not in order of arrival: the total is bit-equal for any number of workers. The own
/// cells in use are listed, so a sum costs only those. There is one total per tick, after all sources are
/// written: the paper's sending policies (§3.2, iv) have no place here (D-041).
///
/// Threads: one writer per own cell, contributions from one thread; total() after the tick's barrier.
/// Real-time: everything but the constructor.
class ForceBuffer {
 public:
  static constexpr std::size_t kContributions = 8;
  /// Limits of a contribution, the only ones that there are: about the peak output of a haptic device. What
  /// is above is clamped, not refused.
  static constexpr double kMaxContributedForce = 50.0;  ///< [N]
  static constexpr double kMaxContributedTorque = 5.0;  ///< [Nm]
  /// [ticks] a contribution ends at most this long after its last update, so that of a source that has ended
  /// nothing stays.
  static constexpr std::uint32_t kMaxLifetimeTicks = 100;

  explicit ForceBuffer(std::size_t own_cells);

  /// Overwrites an own cell.
  void write(std::size_t cell, const Wrench& F_Bq_W, Tick now) noexcept;
  /// Marks an own cell as unused.
  void clear(std::size_t cell) noexcept;

  /// Overwrites the cell of `source` or uses a free one; lifetime and wrench are clamped to the limits above.
  /// False, and counted in rejected(), when the wrench is not finite, its lifetime is 0 or no cell is free.
  bool contribute(std::uint32_t source, const Wrench& F_Bq_W, std::uint32_t lifetime_ticks,
                  Tick now) noexcept;
  /// Frees the cells of contributions whose lifetime is over.
  void expire(Tick now) noexcept;

  /// Sum of all cells in cell order, contributions with their weight at tick `now`.
  [[nodiscard]] Wrench total(Tick now) const noexcept;
  /// Sum of the contributions alone.
  [[nodiscard]] Wrench contributed(Tick now) const noexcept;
  [[nodiscard]] Wrench cell(std::size_t index) const noexcept { return cells_[index].F_Bq_W; }
  /// Ticks since the cell was written.
  [[nodiscard]] Tick age(std::size_t index, Tick now) const noexcept { return now - cells_[index].stamp; }
  [[nodiscard]] std::uint64_t rejected() const noexcept { return rejected_; }

  [[nodiscard]] std::span<const ForceCell> cells() const noexcept { return cells_; }

  /// Writes, reads or hashes the cells in use.
  template <typename Archive, typename Self>
  static void archive(Archive& archive, Self& self) {
    auto own = static_cast<std::uint32_t>(self.used_.size());
    archive(own);
    if constexpr (Archive::kReads) {
      for (const std::uint32_t cell : self.used_) self.cells_[cell] = ForceCell{};
      self.used_.clear();
    }
    for (std::uint32_t i = 0; i < own; ++i) {
      std::uint32_t cell = Archive::kReads ? 0 : self.used_[i];
      archive(cell);
      if constexpr (Archive::kReads) {
        const bool next = cell < self.own_cells_ && (i == 0 || cell > self.used_.back());
        if (!archive.ok() || !next) return archive.reject();
        self.used_.push_back(cell);
      }
      archive(self.cells_[cell]);
      if constexpr (Archive::kReads) {
        if (!self.cells_[cell].used) return archive.reject();
      }
    }
    archive(self.contributing_);
    if constexpr (Archive::kReads) {
      for (ForceCell& cell : std::span(self.cells_).subspan(self.own_cells_)) cell = ForceCell{};
    }
    for (std::size_t i = 0; i < kContributions; ++i) {
      if ((self.contributing_ >> i & 1U) != 0) archive(self.cells_[self.own_cells_ + i]);
    }
  }

 private:
  std::vector<ForceCell> cells_;
  std::vector<std::uint32_t> used_;  // own cells in use, ascending
  std::uint8_t contributing_ = 0;    // bit i: contribution i is in use
  std::size_t own_cells_;
  std::uint64_t rejected_ = 0;
};

}  // namespace tenon::simulation
